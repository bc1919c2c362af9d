//! A worker's offer: the engines that it has, and why it lacks others.

use crate::engine::{self, EngineError, Engines};
use beamfarm_image::job::EngineKind;
use beamfarm_proto::{Lack, Offer};
use std::sync::Arc;

/// The engines of a worker, as reported to a coordinator.
#[derive(Clone, Debug)]
pub struct Offered {
    /// The engines themselves.
    pub engines: Arc<Engines>,
    /// Each engine once. Test pictures are rendered later.
    pub offers: Vec<Offer>,
    /// The engines that it does not offer.
    pub lacks: Vec<Lack>,
}

impl Offered {
    /// Processors only.
    #[must_use]
    pub fn processors() -> Self {
        Self {
            engines: Arc::new(Engines::new("")),
            offers: vec![of(EngineKind::Cpu)],
            lacks: vec![told_not_to(EngineKind::Gpu)],
        }
    }

    /// Only a device of this machine, by its number or part of its name. Opens and tests it.
    ///
    /// # Errors
    /// There is no such device, or it cannot be used.
    pub fn device(gpu: &str) -> Result<Self, EngineError> {
        let engines = Engines::new(gpu);
        let device = engines.device()?;
        Ok(Self {
            engines: Arc::new(engines),
            offers: vec![Offer {
                device: Some(device),
                ..of(EngineKind::Gpu)
            }],
            lacks: vec![told_not_to(EngineKind::Cpu)],
        })
    }

    /// The requested engines; by default processors, and a card if a usable one is found. Software drivers are used
    /// only if named.
    ///
    /// # Errors
    /// A requested engine is missing.
    pub fn look(asked: &[EngineKind], gpu: Option<&str>) -> Result<Self, EngineError> {
        let is_asked = |kind| asked.is_empty() || asked.contains(&kind);
        if !is_asked(EngineKind::Gpu) {
            return Ok(Self::processors());
        }
        let device = match gpu {
            Some(gpu) => Self::device(gpu),
            None => engine::best_card().and_then(|number| Self::device(&number.to_string())),
        };
        match device {
            Ok(mut offered) if is_asked(EngineKind::Cpu) => {
                offered.offers.insert(0, of(EngineKind::Cpu));
                offered.lacks.clear();
                Ok(offered)
            }
            Ok(offered) => Ok(offered),
            Err(why) if asked.contains(&EngineKind::Gpu) || gpu.is_some() => Err(why),
            Err(why) => Ok(Self {
                lacks: vec![Lack {
                    engine: EngineKind::Gpu,
                    reason: why.to_string(),
                }],
                ..Self::processors()
            }),
        }
    }

    /// Whether this engine is offered.
    #[must_use]
    pub fn has(&self, engine: EngineKind) -> bool {
        self.offers.iter().any(|offer| offer.engine == engine)
    }
}

fn of(engine: EngineKind) -> Offer {
    Offer {
        engine,
        canary: None,
        device: None,
    }
}

fn told_not_to(engine: EngineKind) -> Lack {
    Lack {
        engine,
        reason: "it was started without it".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_are_always_there_and_what_is_named_has_to_be() {
        let offered = Offered::look(&[], None).unwrap();
        assert!(offered.has(EngineKind::Cpu));
        // Either there is a card, or there is a reason.
        let lacks: Vec<EngineKind> = offered.lacks.iter().map(|lack| lack.engine).collect();
        assert_eq!(lacks.is_empty(), offered.has(EngineKind::Gpu));
        let alone = Offered::look(&[EngineKind::Cpu], None).unwrap();
        assert!(!alone.has(EngineKind::Gpu) && alone.lacks.len() == 1);
        let error = Offered::look(&[], Some("nobody's")).unwrap_err();
        assert_eq!(error.to_string().lines().count(), 1);
    }
}
