//! Laws that end for good beyond a limit.

use crate::spring::{LengthLaw, Spring};

/// Where a spring breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Above this strain l/l₀ − 1.
    Strain(f64),
    /// Above this tension, in N.
    Tension(f64),
}

/// Any law up to a limit; nothing once it was beyond.
#[derive(Clone, Debug, PartialEq)]
pub struct Breaking<L> {
    /// The law of the whole spring.
    pub law: L,
    /// `None`: it does not break any more, or is broken.
    pub limit: Option<Limit>,
    /// Whether it is broken.
    pub is_broken: bool,
}

impl<L: LengthLaw> Breaking<L> {
    /// Whether the spring is beyond its limit at the length l in m. A tension in N that
    /// is known better than from the length stands for it, also for a strain where the
    /// law there rises with it.
    fn is_beyond(&self, length: f64, known: Option<f64>) -> bool {
        match self.limit {
            None => false,
            Some(Limit::Tension(most)) => known.unwrap_or_else(|| self.law.tension(length)) > most,
            Some(Limit::Strain(most)) => {
                let longest = self.law.rest_length() * (1.0 + most);
                let tension = self.law.tension(longest);
                match known {
                    Some(known) if tension > 0.0 && self.law.stiffness(longest) > 0.0 => {
                        known > tension
                    }
                    _ => length > longest,
                }
            }
        }
    }

    /// What the law gives of a spring that is whole, else nothing.
    #[inline(always)]
    fn if_whole(&self, value: impl FnOnce(&L) -> f64) -> f64 {
        if self.is_broken {
            0.0
        } else {
            value(&self.law)
        }
    }
}

/// The bound on the stiffness is that of the whole spring, so that it holds at all times.
impl<L: LengthLaw> LengthLaw for Breaking<L> {
    #[inline(always)]
    fn energy(&self, length: f64) -> f64 {
        self.if_whole(|law| law.energy(length))
    }

    #[inline(always)]
    fn tension(&self, length: f64) -> f64 {
        self.if_whole(|law| law.tension(length))
    }

    #[inline(always)]
    fn stiffness(&self, length: f64) -> f64 {
        self.if_whole(|law| law.stiffness(length))
    }

    fn largest_stiffness(&self) -> f64 {
        self.law.largest_stiffness()
    }

    fn rest_length(&self) -> f64 {
        self.law.rest_length()
    }

    fn set_spring(&mut self, spring: Spring) {
        self.law.set_spring(spring);
    }

    fn is_convex(&self) -> bool {
        self.law.is_convex()
    }

    fn has_memory(&self) -> bool {
        self.limit.is_some() || self.law.has_memory()
    }

    fn update_memory(&mut self, length: f64, known: Option<f64>) -> f64 {
        if self.is_broken {
            return 0.0;
        }
        let lost = self.law.update_memory(length, known);
        if !self.is_beyond(length, known) {
            return lost;
        }
        let held = self.law.energy(length);
        self.is_broken = true;
        lost + held
    }

    fn would_break(&self, length: f64) -> bool {
        !self.is_broken && self.is_beyond(length, None)
    }

    fn is_broken(&self) -> bool {
        self.is_broken
    }

    fn elongation(&self) -> f64 {
        self.law.elongation()
    }

    fn each_memory(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        let mut is_broken = f64::from(u8::from(self.is_broken));
        visit(&mut is_broken);
        self.is_broken = is_broken != 0.0;
        self.law.each_memory(visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spring::Spring;

    fn spring(limit: Limit) -> Breaking<Spring> {
        Breaking {
            law: Spring {
                stiffness: 50.0,
                rest_length: 2.0,
            },
            limit: Some(limit),
            is_broken: false,
        }
    }

    /// Both limits are at 2.5 m, where K s = 25 N.
    #[test]
    fn it_breaks_above_its_limit_and_gives_what_it_held() {
        for limit in [Limit::Strain(0.25), Limit::Tension(25.0)] {
            let mut spring = spring(limit);
            assert_eq!(spring.update_memory(0.1, None), 0.0);
            assert_eq!(spring.update_memory(2.5, None), 0.0);
            assert!(!spring.would_break(2.5) && spring.would_break(2.6));
            assert!(!spring.is_broken() && spring.tension(2.5) == 25.0);
            // ½·50·0.75², without rounding.
            assert_eq!(spring.update_memory(2.75, None), 14.0625);
            assert!(spring.is_broken());
            let gives = [
                spring.energy(3.0),
                spring.tension(3.0),
                spring.stiffness(3.0),
            ];
            assert_eq!(gives, [0.0; 3]);
            assert_eq!(spring.update_memory(5.0, None), 0.0);
            assert_eq!(spring.largest_stiffness(), 50.0);
        }
    }

    #[test]
    fn a_tension_that_is_known_decides() {
        for limit in [Limit::Strain(0.25), Limit::Tension(25.0)] {
            let mut spring = spring(limit);
            spring.update_memory(9.0, Some(24.9));
            assert!(!spring.is_broken(), "{limit:?}");
            spring.update_memory(2.0, Some(25.1));
            assert!(spring.is_broken(), "{limit:?}");
        }
    }

    #[test]
    fn what_it_remembers_is_saved_and_restored() {
        let mut broken = spring(Limit::Strain(0.1));
        broken.update_memory(9.0, None);
        let mut saved = 0.0;
        broken.each_memory(&mut |word| saved = *word);
        let mut other = spring(Limit::Strain(0.1));
        other.each_memory(&mut |word| *word = saved);
        assert_eq!(other, broken);
    }
}
