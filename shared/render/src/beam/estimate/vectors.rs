//! The same code for each kind of vectors.

/// Kinds of vector code. Only the number of lanes per instruction differs: no operation is fused or reordered, so the
/// bits are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vectors {
    /// What every machine of this kind has: SSE2, NEON.
    Baseline,
    /// 8 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 16 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Vectors {
    /// Those that this machine has, the narrowest first.
    pub fn available() -> impl DoubleEndedIterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let all = {
            let avx2 = std::arch::is_x86_feature_detected!("avx2");
            let avx512 = std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512bw")
                && std::arch::is_x86_feature_detected!("avx512vl");
            [
                Some(Self::Baseline),
                avx2.then_some(Self::Avx2),
                (avx2 && avx512).then_some(Self::Avx512),
            ]
        };
        #[cfg(not(target_arch = "x86_64"))]
        let all = [Some(Self::Baseline)];
        all.into_iter().flatten()
    }

    /// The widest that this machine has.
    pub fn widest() -> Self {
        Self::available().next_back().unwrap_or(Self::Baseline)
    }

    /// These, or the baseline on a machine without them.
    pub(super) fn found(self) -> Found {
        match Self::available().any(|available| available == self) {
            true => Found(self),
            false => Found(Self::Baseline),
        }
    }
}

/// Vectors that this machine has: only [`Vectors::found`] makes one.
#[derive(Clone, Copy)]
pub(super) struct Found(Vectors);

/// Code to be compiled for each kind of vectors.
pub(super) trait Work {
    /// All that it calls should be `#[inline(always)]` as this is, or else it is code for the baseline.
    fn run(self);
}

impl Found {
    /// Runs the code for these vectors.
    #[inline]
    pub fn run(self, work: impl Work) {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn avx2(work: impl Work) {
                work.run();
            }
            #[target_feature(enable = "avx2,avx512f,avx512dq,avx512bw,avx512vl")]
            fn avx512(work: impl Work) {
                work.run();
            }
            match self.0 {
                Vectors::Baseline => {}
                // SAFETY: the machine has these.
                Vectors::Avx2 => return unsafe { avx2(work) },
                // SAFETY: the machine has these.
                Vectors::Avx512 => return unsafe { avx512(work) },
            }
        }
        work.run();
    }
}
