//! What a run carries along beside positions and velocities, saved and loaded.

use nalgebra::Vector3;
use std::time::Duration;

/// A walk through the state of a run, in one order for saving and for loading,
/// so that the two cannot disagree: every part of the state hands over its
/// fields, which are either written down or replaced.
///
/// A run that goes on from a saved state gives the same bits as one that was
/// never stopped.
#[derive(Clone, Debug, Default)]
pub struct Archive {
    words: Vec<u64>,
    /// The next word to be loaded; `None` while saving.
    next: Option<usize>,
    is_sound: bool,
}

/// The saved state does not belong to the run that it was loaded into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the saved state does not fit the scene")]
pub struct ForeignState;

impl Archive {
    /// To be filled.
    pub(crate) fn saving() -> Self {
        Self::saving_into(Vec::new())
    }

    /// The same, in place of other words.
    pub(crate) fn saving_into(mut words: Vec<u64>) -> Self {
        words.clear();
        Self {
            words,
            next: None,
            is_sound: true,
        }
    }

    /// To be loaded from.
    pub(crate) fn loading(words: Vec<u64>) -> Self {
        Self {
            words,
            next: Some(0),
            is_sound: true,
        }
    }

    /// The words that were saved.
    pub(crate) fn into_words(self) -> Vec<u64> {
        self.words
    }

    pub(crate) fn is_loading(&self) -> bool {
        self.next.is_some()
    }

    /// Whether everything was as expected so far.
    pub(crate) fn is_sound(&self) -> bool {
        self.is_sound
    }

    /// Whatever was loaded is of no use.
    pub(crate) fn refuse(&mut self) {
        self.is_sound = false;
    }

    /// # Errors
    ///
    /// If what was loaded was not what was asked for, or not all of it.
    pub(crate) fn finish(self) -> Result<(), ForeignState> {
        let is_used_up = self.next.is_none_or(|next| next == self.words.len());
        if self.is_sound && is_used_up {
            Ok(())
        } else {
            Err(ForeignState)
        }
    }

    /// A whole number.
    pub fn word(&mut self, word: &mut u64) {
        match &mut self.next {
            None => self.words.push(*word),
            Some(next) => match self.words.get(*next) {
                Some(saved) if self.is_sound => {
                    *word = *saved;
                    *next += 1;
                }
                _ => self.is_sound = false,
            },
        }
    }

    /// A small whole number.
    pub fn count(&mut self, count: &mut u32) {
        let mut word = u64::from(*count);
        self.word(&mut word);
        match u32::try_from(word) {
            Ok(word) => *count = word,
            Err(_) => self.is_sound = false,
        }
    }

    /// A number, bit by bit; it may be infinite.
    pub fn real(&mut self, real: &mut f64) {
        let mut bits = real.to_bits();
        self.word(&mut bits);
        *real = f64::from_bits(bits);
        self.is_sound &= !(self.is_loading() && real.is_nan());
    }

    fn finite(&mut self, real: &mut f64) {
        self.real(real);
        self.is_sound &= !self.is_loading() || real.is_finite();
    }

    /// A truth.
    pub fn flag(&mut self, flag: &mut bool) {
        let mut word = u64::from(*flag);
        self.word(&mut word);
        self.is_sound &= word <= 1;
        *flag = word == 1;
    }

    /// Finite numbers; there must be as many when they are loaded.
    pub fn reals(&mut self, reals: &mut [f64]) {
        self.length(reals.len());
        if !self.is_loading() {
            self.words.extend(reals.iter().map(|real| real.to_bits()));
            return;
        }
        reals.iter_mut().for_each(|real| self.finite(real));
    }

    /// Finite numbers, `n` of them or none.
    pub(crate) fn reals_or_none(&mut self, reals: &mut Vec<f64>, n: usize) {
        let mut are_there = !reals.is_empty();
        self.flag(&mut are_there);
        if self.is_loading() {
            reals.clear();
            reals.resize(if are_there { n } else { 0 }, 0.0);
        }
        reals.iter_mut().for_each(|real| self.finite(real));
    }

    /// Finite vectors; there must be as many when they are loaded.
    pub fn vectors(&mut self, vectors: &mut [Vector3<f64>]) {
        self.length(vectors.len());
        if !self.is_loading() {
            let components = vectors.iter().flatten();
            self.words.extend(components.map(|real| real.to_bits()));
            return;
        }
        for component in vectors.iter_mut().flatten() {
            self.finite(component);
        }
    }

    /// Whole numbers, as many as were saved.
    pub(crate) fn words(&mut self, words: &mut Vec<u64>) {
        let mut length = words.len() as u64;
        self.word(&mut length);
        if self.is_loading() {
            // No longer than there is something to load.
            *words = vec![0; (length as usize).min(self.words.len())];
        }
        words.iter_mut().for_each(|word| self.word(word));
    }

    pub(crate) fn duration(&mut self, duration: &mut Duration) {
        let mut nanoseconds = duration.as_nanos() as u64;
        self.word(&mut nanoseconds);
        *duration = Duration::from_nanos(nanoseconds);
    }

    pub(crate) fn text(&mut self, text: &mut String) {
        let mut words: Vec<u64> = text.bytes().map(u64::from).collect();
        self.words(&mut words);
        let bytes = words.iter().map(|&word| word as u8).collect();
        *text = String::from_utf8(bytes).unwrap_or_default();
    }

    /// A value that may be there.
    pub(crate) fn option<T: Default>(
        &mut self,
        option: &mut Option<T>,
        archive: impl FnOnce(&mut T, &mut Self),
    ) {
        let mut is_some = option.is_some();
        self.flag(&mut is_some);
        if is_some {
            archive(option.get_or_insert_default(), self)
        } else {
            *option = None
        }
    }

    fn length(&mut self, length: usize) {
        let mut word = length as u64;
        self.word(&mut word);
        self.is_sound &= word == length as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Thing {
        word: u64,
        real: f64,
        flag: bool,
        vectors: Vec<Vector3<f64>>,
        text: String,
        option: Option<f64>,
    }

    impl Thing {
        fn archive(&mut self, archive: &mut Archive) {
            archive.word(&mut self.word);
            archive.real(&mut self.real);
            archive.flag(&mut self.flag);
            archive.vectors(&mut self.vectors);
            archive.text(&mut self.text);
            archive.option(&mut self.option, |real, archive| archive.real(real));
        }
    }

    fn thing() -> Thing {
        Thing {
            word: 7,
            real: -0.0,
            flag: true,
            vectors: vec![Vector3::new(1.0, f64::MIN_POSITIVE, -3.0); 2],
            text: "cheaper from l₀ on".to_owned(),
            option: Some(2.5),
        }
    }

    fn other() -> Thing {
        Thing {
            word: 0,
            real: 1.0,
            flag: false,
            vectors: vec![Vector3::zeros(); 2],
            text: String::new(),
            option: None,
        }
    }

    #[test]
    fn what_is_saved_is_loaded() {
        let mut saved = Archive::saving();
        thing().archive(&mut saved);
        let mut loaded = Archive::loading(saved.into_words());
        let mut thing = other();
        thing.archive(&mut loaded);
        loaded.finish().unwrap();
        let expected = self::thing();
        assert_eq!(thing.real.to_bits(), expected.real.to_bits());
        assert_eq!((thing.word, thing.flag), (expected.word, expected.flag));
        assert_eq!(thing.vectors, expected.vectors);
        assert_eq!((thing.text, thing.option), (expected.text, expected.option));
    }

    /// Every word cut off, turned into another one, or added.
    #[test]
    fn other_states_are_refused_without_a_panic() {
        let mut saved = Archive::saving();
        thing().archive(&mut saved);
        let words = saved.into_words();
        let refused = |words: &[u64]| {
            let mut archive = Archive::loading(words.to_vec());
            other().archive(&mut archive);
            archive.finish().is_err()
        };
        for length in 0..words.len() {
            assert!(refused(&words[..length]), "{length} words");
        }
        assert!(refused(&[&words[..], &[0]].concat()));
        for index in 0..words.len() {
            let mut words = words.clone();
            words[index] = u64::MAX;
            refused(&words);
        }
        let mut more = other();
        more.vectors.push(Vector3::zeros());
        let mut archive = Archive::loading(words);
        more.archive(&mut archive);
        assert!(archive.finish().is_err());
    }
}
