//! Lists of values.

/// A list of values is not one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValuesError {
    /// Not a finite number.
    #[error("`{text}` is not a finite number")]
    NoNumber {
        /// What is there.
        text: String,
    },
    /// Not a range.
    #[error(
        "`{text}` is not a range: log:FROM:TO:N and lin:FROM:TO:N have N values, ends included"
    )]
    NoRange {
        /// What is there.
        text: String,
    },
    /// A logarithm of it is not a number.
    #[error("a range in logarithms is between positive numbers")]
    NotPositive,
}

/// A range has at most so many values.
const MOST: usize = 1_000_000;

/// Values from `log:FROM:TO:N`, `lin:FROM:TO:N`, or numbers with commas between them.
///
/// # Errors
///
/// If it is none of these.
pub fn values(text: &str) -> Result<Vec<f64>, ValuesError> {
    let text = text.trim();
    let is_log = text.starts_with("log:");
    let Some(range) = text
        .strip_prefix("log:")
        .or_else(|| text.strip_prefix("lin:"))
    else {
        return text.split(',').map(number).collect();
    };
    let no_range = || ValuesError::NoRange {
        text: text.to_owned(),
    };
    let parts: Vec<&str> = range.split(':').collect();
    let &[from, to, n] = &parts[..] else {
        return Err(no_range());
    };
    let (from, to) = (number(from)?, number(to)?);
    let n: usize = n.trim().parse().map_err(|_| no_range())?;
    if !(1..=MOST).contains(&n) {
        return Err(no_range());
    }
    if is_log && !(from > 0.0 && to > 0.0) {
        return Err(ValuesError::NotPositive);
    }
    let value = |k: usize| {
        let part = k as f64 / (n - 1).max(1) as f64;
        if k == 0 {
            from
        } else if k == n - 1 {
            to
        } else if is_log {
            from * (to / from).powf(part)
        } else {
            from + (to - from) * part
        }
    };
    Ok((0..n).map(value).collect())
}

fn number(text: &str) -> Result<f64, ValuesError> {
    let text = text.trim();
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| ValuesError::NoNumber {
        text: text.to_owned(),
    })
}
