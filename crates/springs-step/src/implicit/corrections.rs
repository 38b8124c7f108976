//! How the corrections of a stage shrink, and what that says of the next ones.

/// Corrections may stop shrinking when they are so many times what rounding explains.
const ACCEPTABLE: f64 = 1e3;
/// The part of rounding that old matrices may leave.
const PART_LEFT: f64 = 0.1;
/// A correction with an old matrix that is not smaller than the last one by this factor
/// is thrown away.
pub(crate) const SLOW: f64 = 0.5;
/// In stages.
const LONGEST_PAUSE: u32 = 64;

/// A correction of velocities and the one before.
#[derive(Clone, Copy)]
pub(crate) struct Progress {
    /// Of the present one, in m/s, and of the last one; infinite if it is the first.
    pub(crate) size: f64,
    pub(crate) last: f64,
    /// Whether it was made with an old matrix.
    pub(crate) is_chord: bool,
    /// Whether both were made with new ones.
    pub(crate) is_newton: bool,
}

/// What is asked of corrections.
#[derive(Clone, Copy)]
pub(crate) struct Goal {
    /// From which size on they are rounding, in m/s.
    pub(crate) rounding: f64,
    /// What may be left, in m/s; `None`: rounding.
    pub(crate) accuracy: Option<f64>,
}

impl Progress {
    /// What is left after the correction, in m/s, if the next ones fall off as this one
    /// did (Hairer and Wanner: Solving Ordinary Differential Equations II, 1996, IV.8).
    fn left(&self) -> f64 {
        let contraction = self.size / self.last;
        if self.last.is_infinite() {
            self.size
        } else if contraction < 1.0 {
            self.size * contraction / (1.0 - contraction)
        } else {
            f64::INFINITY
        }
    }

    /// Whether the correction is the last.
    pub(crate) fn is_enough(&self, Goal { rounding, accuracy }: Goal) -> bool {
        let (size, left) = (self.size, self.left());
        // Newton's corrections leave nothing, and stop shrinking at rounding; those with
        // an old matrix leave a part.
        let is_at_rounding = if self.is_chord {
            size <= rounding && left <= PART_LEFT * rounding
        } else {
            let is_still = size <= ACCEPTABLE * rounding && size >= 0.1 * self.last;
            size <= rounding || (self.is_newton && is_still)
        };
        is_at_rounding || accuracy.is_some_and(|accuracy| left <= accuracy)
    }

    /// How many more corrections with the same matrix it takes.
    pub(crate) fn corrections_left(&self, Goal { rounding, accuracy }: Goal) -> f64 {
        if self.last.is_infinite() {
            return 0.0;
        }
        if self.size >= self.last {
            return f64::INFINITY;
        }
        let wanted = accuracy.unwrap_or(rounding).max(rounding);
        (wanted / self.size).ln() / (self.size / self.last).ln()
    }
}

/// Whether old matrices are used: not for some stages after one has failed.
#[derive(Clone, Copy, Default)]
pub(crate) struct Chord {
    /// Stages to go without, and how many there were the last time.
    pub(crate) pause: u32,
    pub(crate) last_pause: u32,
}

impl Chord {
    /// A stage begins; says whether it may use an old matrix.
    pub(crate) fn begin(&mut self) -> bool {
        let is_wanted = self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        if is_wanted {
            self.last_pause /= 2;
        }
        is_wanted
    }

    /// A correction with an old matrix was thrown away.
    pub(crate) fn fail(&mut self) {
        self.last_pause = (4 * self.last_pause).clamp(1, LONGEST_PAUSE);
        self.pause = self.last_pause;
    }
}
