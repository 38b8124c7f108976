//! Text from elsewhere, made fit to be shown.

/// Longer text is cut, in characters.
const MOST_CHARACTERS: usize = 200;

/// A name or other text from a scene as a message or a picture can show it: on
/// one line, control characters other than tabs written out (`\u{1b}`), so that they neither
/// move a terminal's cursor nor spoil an XML file, and cut after 200 characters.
///
/// ```
/// use springs_scene::printable;
/// assert_eq!(printable("bridge № 3"), "bridge № 3");
/// assert_eq!(printable("\u{1b}[31mred\n"), "\\u{1b}[31mred\\n");
/// ```
pub fn printable(text: &str) -> String {
    printable_within(text, MOST_CHARACTERS)
}

/// [`printable`] with another limit than 200 characters.
pub fn printable_within(text: &str, most_characters: usize) -> String {
    let mut shown = String::new();
    for (n, character) in text.chars().enumerate() {
        if n == most_characters {
            shown.push('…');
            break;
        }
        if is_harmless(character) {
            shown.push(character);
        } else {
            shown.extend(character.escape_default());
        }
    }
    shown
}

/// Neither a control character other than a tab, nor one that reverses or breaks lines, nor one
/// that XML has no room for.
fn is_harmless(character: char) -> bool {
    character == '\t'
        || !character.is_control()
            && !matches!(
                character,
                '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}'
            )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_reaches_a_terminal_raw() {
        assert_eq!(printable("a\tb"), "a\tb");
        let name = "\u{1b}]0;title\u{7}a\r\nerror: b\u{9b}31m\u{202e}\u{ffff}\0";
        let shown = printable(name);
        assert!(shown.is_ascii(), "{shown}");
        assert!(!shown.chars().any(char::is_control), "{shown}");
        assert!(shown.starts_with("\\u{1b}]0;title\\u{7}a\\r\\nerror: b"));
    }

    #[test]
    fn long_text_is_cut() {
        let shown = printable(&"é".repeat(3_000_000));
        assert_eq!(shown.chars().count(), MOST_CHARACTERS + 1);
        assert!(shown.ends_with("é…"));
        let fits = "é".repeat(MOST_CHARACTERS);
        assert_eq!(printable(&fits), fits);
    }
}
