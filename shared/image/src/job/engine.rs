//! What renders passes.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// What renders passes. Each engine has its own bits, so passes of different engines are never averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// The CPU.
    #[default]
    Cpu,
    /// A GPU, through Vulkan.
    Gpu,
}

/// Versions of the passes' bits. They grow whenever the bits change, independently of the program's version. Passes of
/// different versions are never averaged.
const CPU_BITS: u32 = 6;
const GPU_BITS: u32 = 8;

impl EngineKind {
    /// Tells engines apart between programs of the same version: the version of the GPU's bits, or 0 for the CPU.
    #[must_use]
    pub fn gpu_bits(self) -> u32 {
        match self {
            Self::Cpu => 0,
            Self::Gpu => GPU_BITS,
        }
    }

    /// The engine with these [`Self::gpu_bits`], if this program has it.
    #[must_use]
    pub fn of_gpu_bits(bits: u32) -> Option<Self> {
        [Self::Cpu, Self::Gpu]
            .into_iter()
            .find(|engine| engine.gpu_bits() == bits)
    }

    /// The engine's name with the version of its bits: `cpu 6`, `gpu 8`. Tells jobs apart.
    #[must_use]
    pub fn identity(self) -> String {
        let bits = match self {
            Self::Cpu => CPU_BITS,
            Self::Gpu => GPU_BITS,
        };
        format!("{self} {bits}")
    }

    /// The engine with this [`Self::identity`], if this program has it.
    ///
    /// # Errors
    /// What was found and what was expected.
    pub fn identified(text: &str) -> Result<Self, String> {
        let all = [Self::Cpu, Self::Gpu];
        all.into_iter().find(|engine| engine.identity() == text).ok_or_else(|| {
            let found: String = text.chars().take(80).collect();
            let [cpu, gpu] = all.map(Self::identity);
            format!("the engine is {found:?}; expected {cpu} or {gpu}")
        })
    }
}

impl fmt::Display for EngineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        })
    }
}

impl FromStr for EngineKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => Err("expected cpu or gpu".into()),
        }
    }
}

/// Which engine renders a job's passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngineChoice {
    /// This engine.
    Is(EngineKind),
    /// The faster engine on the machine that renders, which has to be measured. The job then belongs to that one.
    Auto,
}

impl EngineChoice {
    /// The engine, if it is set.
    #[must_use]
    pub fn said(self) -> Option<EngineKind> {
        match self {
            Self::Is(engine) => Some(engine),
            Self::Auto => None,
        }
    }
}

impl FromStr for EngineChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            _ => text
                .parse()
                .map(Self::Is)
                .map_err(|_| "expected cpu, gpu or auto".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn engines_are_known_by_name_and_by_the_version_of_their_bits() {
        for engine in [EngineKind::Cpu, EngineKind::Gpu] {
            assert_eq!(engine.to_string().parse(), Ok(engine));
            assert_eq!(EngineKind::identified(&engine.identity()), Ok(engine));
            assert_eq!(EngineKind::of_gpu_bits(engine.gpu_bits()), Some(engine));
        }
        assert_eq!(EngineKind::default().identity(), format!("cpu {CPU_BITS}"));
        assert_eq!(EngineKind::Gpu.identity(), format!("gpu {GPU_BITS}"));
        for other in [
            "",
            "gpu",
            "gpu 0",
            "GPU 1",
            "cpu",
            "cpu 0",
            &format!("gpu {}", GPU_BITS + 1),
        ] {
            let error = EngineKind::identified(other).unwrap_err();
            let expected = format!("the engine is {other:?}; expected cpu {CPU_BITS} or gpu {GPU_BITS}");
            assert_eq!(error, expected);
        }
        assert_eq!(EngineKind::of_gpu_bits(GPU_BITS + 1), None);
        assert_eq!("tpu".parse::<EngineKind>(), Err("expected cpu or gpu".to_owned()));
    }

    #[test]
    fn a_choice_is_an_engine_or_auto() {
        let choice = |text: &str| text.parse::<EngineChoice>();
        assert_eq!(choice("auto"), Ok(EngineChoice::Auto));
        assert_eq!(choice("gpu").map(EngineChoice::said), Ok(Some(EngineKind::Gpu)));
        assert_eq!(choice("tpu"), Err("expected cpu, gpu or auto".into()));
        assert_eq!(EngineChoice::Auto.said(), None);
    }
}
