//! Numbers and names as sentences have them.

/// "3 springs", "1 spring".
pub fn count(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        _ => format!("{n} {what}s"),
    }
}

/// "springs 3, 4, 5 and 12 more".
pub(crate) fn name_them(what: &str, indices: &[usize]) -> String {
    const NAMED: usize = 3;
    let named: Vec<String> = indices.iter().take(NAMED).map(usize::to_string).collect();
    let list = named.join(", ");
    match indices.len() {
        1 => format!("{what} {list}"),
        n if n <= NAMED => format!("{what}s {list}"),
        n => format!("{what}s {list} and {} more", n - NAMED),
    }
}

/// The verb after what [`name_them`] names.
pub(crate) fn are(indices: &[usize]) -> &'static str {
    if indices.len() == 1 { "is" } else { "are" }
}

/// Four significant digits.
pub fn short(value: f64) -> String {
    let text = format!("{value:.3e}");
    let rounded: f64 = text.parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        1e-3..1e7 => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

/// Two significant digits.
pub(crate) fn rounded(value: f64) -> String {
    let text = format!("{value:.1e}");
    match text.parse::<f64>() {
        Ok(value) if (1e-3..1e5).contains(&value.abs()) => value.to_string(),
        _ => text,
    }
}

/// "1.2 ms", "3.4 s", "5 min 6 s", "3 h 20 min", "12 days".
pub fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.0} µs", s * 1e6),
        s if s < 0.1 => format!("{:.1} ms", s * 1e3),
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 59.95 => format!("{s:.1} s"),
        s if s < 3600.0 => {
            let whole = s.round() as u64;
            format!("{} min {} s", whole / 60, whole % 60)
        }
        s if s < 48.0 * 3600.0 => {
            let minutes = (s / 60.0).round() as u64;
            format!("{} h {} min", minutes / 60, minutes % 60)
        }
        s => format!("{} days", short((s / 86400.0).round())),
    }
}

/// "850 kB", "1.2 MB", "3.4 GB".
pub(crate) fn memory(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        b if b < 1e6 => format!("{:.0} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_the_units_that_people_use() {
        let said = [2e-5, 0.0123, 0.5, 12.34, 306.0, 12_000.0, 1e6].map(time);
        let expected = [
            "20 µs",
            "12.3 ms",
            "500 ms",
            "12.3 s",
            "5 min 6 s",
            "3 h 20 min",
            "12 days",
        ];
        assert_eq!(said, expected);
    }
}
