//! What is wrong with a text that does not read as a scene, in words for its
//! author.
//!
//! The RON reader stops where it can make no more sense of the text. Where the
//! cause is a mistake that people make, such as an unclosed bracket or a
//! decimal comma, it is looked for in the text itself.

use crate::locate::{Place, Walker, place_of};
use crate::read::Finding;
use crate::scene_file::{SceneFile, VERSION};
use springs_scene::{LinearTolerance, Method, Tangent};
use std::str::FromStr;

/// The first fault of a text that the RON reader refused with `error`.
pub(crate) fn finding(
    options: &ron::Options,
    text: &str,
    error: &ron::error::SpannedError,
) -> Finding {
    let position = error.span.start;
    let place = Place {
        line: position.line,
        column: position.col,
    };
    // The reader stops before white space, the mistake is behind it.
    let offset = Walker::at_value(text, offset_of(text, place)).at;
    if !starts_like_a_scene(text) {
        let start = Walker::at_value(text, 0).at;
        let message = "this is not a scene file: one starts with `Scene(`".to_owned();
        return Finding::in_text(text, place_of(text, start), String::new(), message, None);
    }
    let mut path = path_of_fault(options, text);
    let found = Faults::of(text, offset);
    // Where these begin, all that follows is inside of them.
    let is_open = matches!(
        error.code,
        ron::Error::ExpectedStringEnd | ron::Error::UnclosedBlockComment
    );
    let bracket = found
        .bracket
        .filter(|fault| fault.start <= offset && !is_open);
    if let (None, Some(_)) = (&found.token, &bracket) {
        path.clear();
    }
    if let Some(Fault { start, message }) = found.token.or(bracket) {
        return Finding::in_text(text, place_of(text, start), path, message, None);
    }
    let enclosing = found.enclosing;
    let (place, advice) = match &error.code {
        ron::Error::MissingStructField { field, .. } => {
            let opened = place_of(text, enclosing.unwrap_or(offset));
            let advice = (*field == "version").then(|| format!("add `version: {VERSION},` here"));
            (opened, advice)
        }
        _ => (place, None),
    };
    let message = match &error.code {
        ron::Error::SuggestRawIdentifier(found) | ron::Error::InvalidIdentifier(found)
            if path.ends_with("breaks_at") =>
        {
            format!("say what breaks it: Strain({found}) or Force({found})")
        }
        ron::Error::ExpectedStructLike => {
            let before = text[..offset].trim_end();
            let word = &before[before.trim_end_matches(is_in_word).len()..];
            format!("`{word}` takes a pair of brackets, even an empty one: `{word}(…)`")
        }
        code => message(code),
    };
    Finding::in_text(text, place, path, message, advice)
}

/// Reads once more, keeping track of the path, which the fast way does not.
fn path_of_fault(options: &ron::Options, text: &str) -> String {
    let path = ron::Deserializer::from_str_with_options(text, options)
        .ok()
        .and_then(|mut deserializer| {
            serde_path_to_error::deserialize::<_, SceneFile>(&mut deserializer).err()
        })
        .map(|error| error.path().to_string())
        .unwrap_or_default();
    // A question mark stands where the name of the field was not reached.
    let known = path.strip_suffix('?').unwrap_or(&path);
    known.trim_end_matches('.').to_owned()
}

/// The reader's own words where they serve, plainer ones elsewhere.
fn message(error: &ron::Error) -> String {
    use ron::Error as E;
    match error {
        E::Eof => "the file ends in the middle of the scene".to_owned(),
        E::ExpectedNamedStructLike("Scene") => "a scene file starts with `Scene(`".to_owned(),
        E::ExpectedDifferentStructName { expected, found } => {
            format!("`{expected}(` is expected here, not `{found}`")
        }
        E::ExpectedComma => "a comma or a closing bracket is missing before this".to_owned(),
        E::ExpectedMapColon => "a colon is missing between the field and its value".to_owned(),
        E::ExpectedFloat => "a number is expected here".to_owned(),
        E::ExpectedInteger => "a whole number is expected here".to_owned(),
        E::ExpectedBoolean => "`true` or `false` is expected here".to_owned(),
        E::ExpectedString => "a text in quotes is expected here".to_owned(),
        E::ExpectedStringEnd => "the closing quote of this text is missing".to_owned(),
        E::ExpectedIdentifier => "a name without quotes is expected here".to_owned(),
        E::UnclosedBlockComment => "a comment that starts with `/*` is not closed".to_owned(),
        E::SuggestRawIdentifier(found) | E::InvalidIdentifier(found) => {
            format!("`{found}` is not the name of a field")
        }
        E::TrailingCharacters => "there is more after the end of the scene".to_owned(),
        E::InvalidValueForType { expected, found } => {
            format!("{expected} is expected here, not {found}")
        }
        E::ExpectedDifferentLength { expected, found } => {
            format!("{expected} is expected here, not {found} of them")
        }
        E::MissingStructField { field, .. } => format!("the field `{field}` is missing"),
        E::DuplicateStructField { field, .. } => format!("the field `{field}` stands here twice"),
        E::NoSuchStructField {
            found, expected, ..
        } => format!(
            "there is no field `{found}` here; known are {}",
            expected.join(", ")
        ),
        E::NoSuchEnumVariant {
            found, expected, ..
        } => {
            let known = expected.join(", ");
            format!("`{found}` is not known here; known are {known}")
        }
        other => other.to_string(),
    }
}

fn offset_of(text: &str, place: Place) -> usize {
    let lines = text.split_inclusive('\n').take(place.line - 1);
    let start: usize = lines.map(str::len).sum();
    let mut characters = text[start..].char_indices();
    characters
        .nth(place.column - 1)
        .map_or(text.len(), |(offset, _)| start + offset)
}

/// Whether a bracket, or a name and a bracket, is the first thing in the text;
/// lines that start with `#` are taken for attempts at comments.
fn starts_like_a_scene(text: &str) -> bool {
    let mut walker = Walker::at_value(text, 0);
    while walker.rest().starts_with('#') {
        walker.skip_while(|c| c != '\n');
        walker.skip_to_value();
    }
    walker.skip_while(is_in_word);
    walker.skip_to_value();
    walker.rest().starts_with('(')
}

/// A mistake in the text, at an offset in bytes.
struct Fault {
    start: usize,
    message: String,
}

/// A bracket that is open.
struct Bracket {
    opening: char,
    start: usize,
    /// The field whose value is being read.
    field: Option<String>,
}

/// What is found in a text up to an offset, where the reader stopped.
#[derive(Default)]
struct Faults {
    /// The first mistake up to there that is not one of brackets.
    token: Option<Fault>,
    /// Brackets that do not match, anywhere.
    bracket: Option<Fault>,
    /// Where the innermost bracket around the offset opens.
    enclosing: Option<usize>,
}

impl Faults {
    fn of(text: &str, until: usize) -> Self {
        let mut faults = Self::default();
        let mut open: Vec<Bracket> = Vec::new();
        // The last word, and the last that a comma follows at once.
        let (mut word, mut before_comma) = (0..0, 0..0);
        let mut walker = Walker::at_value(text, 0);
        while let Some(c) = walker.rest().chars().next() {
            let start = walker.at;
            if start <= until {
                faults.enclosing = open.last().map(|bracket| bracket.start);
            }
            let field = open.last().and_then(|bracket| bracket.field.as_deref());
            let mut message = None;
            match c {
                '(' | '[' | '{' => {
                    open.push(Bracket {
                        opening: c,
                        start,
                        field: None,
                    });
                    walker.skip_character();
                }
                ')' | ']' | '}' => {
                    faults.bracket = mismatch(text, open.pop(), c, start);
                    if faults.bracket.is_some() {
                        return faults;
                    }
                    walker.skip_character();
                }
                ':' => {
                    if let Some(bracket) = open.last_mut() {
                        bracket.field = Some(text[word.clone()].to_owned());
                    }
                    walker.skip_character();
                }
                ',' => {
                    before_comma = word.clone();
                    walker.skip_character();
                }
                '#' => {
                    message = Some("a comment starts with `//`, not with `#`".to_owned());
                    walker.skip_while(|c| c != '\n');
                }
                '"' => {
                    walker.skip_string();
                    let content = text[start..walker.at].trim_matches('"');
                    let name = field.and_then(|field| named(field, content));
                    message = name.map(|name| format!("write {name}, without quotes"));
                }
                'r' if walker.starts_raw_string() => walker.skip_raw_string(),
                c if is_in_word(c) => {
                    walker.skip_while(is_in_word);
                    word = start..walker.at;
                    let (before, found) = (&text[before_comma.clone()], &text[word.clone()]);
                    let is_after_comma = before_comma.end + 1 == start && field.is_some();
                    if is_after_comma && is_whole_number(before) && starts_with_digit(found) {
                        message = Some(format!(
                            "a number has a decimal point, not a comma: {before}.{found}"
                        ));
                    } else if found.starts_with(char::is_alphabetic) && found.contains('-') {
                        walker.skip_to_value();
                        message = hyphenated(found, field, walker.rest().starts_with(':'));
                    }
                }
                _ => walker.skip_character(),
            }
            if let (Some(message), None, true) = (message, &faults.token, start <= until) {
                faults.token = Some(Fault { start, message });
            }
            walker.skip_to_value();
        }
        faults.bracket = open.last().map(|bracket| Fault {
            start: bracket.start,
            message: format!(
                "this `{}` is not closed before the file ends",
                bracket.opening
            ),
        });
        faults
    }
}

/// A closing bracket that does not belong to the last one that was opened.
fn mismatch(text: &str, opened: Option<Bracket>, closing: char, start: usize) -> Option<Fault> {
    let Some(Bracket {
        opening,
        start: opened_at,
        ..
    }) = opened
    else {
        return Some(Fault {
            start,
            message: format!("this `{closing}` closes nothing"),
        });
    };
    let fitting = match opening {
        '(' => ')',
        '[' => ']',
        _ => '}',
    };
    let Place { line, column } = place_of(text, start);
    (closing != fitting).then(|| Fault {
        start: opened_at,
        message: format!(
            "this `{opening}` is not closed: the `{closing}` in line {line}, column {column} \
             comes before its `{fitting}`"
        ),
    })
}

/// What is wrong with a name with hyphens, as they are on the command line.
fn hyphenated(found: &str, field: Option<&str>, is_field: bool) -> Option<String> {
    if is_field {
        let with_underscores = found.replace('-', "_");
        return Some(format!("fields are written with `_`: {with_underscores}"));
    }
    let name = named(field?, found)?;
    Some(format!(
        "in a scene file this is written {name}; `{found}` is for the command line"
    ))
}

/// The spelling in scene files of a name that the field may hold.
fn named(field: &str, name: &str) -> Option<&'static str> {
    match field {
        "method" => Method::from_str(name).ok().map(Method::name),
        "tangent" => Tangent::from_str(name).ok().map(Tangent::name),
        "solution" => LinearTolerance::from_str(name)
            .ok()
            .map(LinearTolerance::name),
        _ => None,
    }
}

fn is_in_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-' | '+' | '.')
}

fn starts_with_digit(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
}

fn is_whole_number(text: &str) -> bool {
    text.parse::<i64>().is_ok()
}
