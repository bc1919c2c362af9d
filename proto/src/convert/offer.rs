//! Conversions of workers' offers.

use super::{WireError, WireHash};
use crate::domain::{Device, FileHash, Lack, Offer};
use crate::wire;
use beamfarm_image::job::EngineKind;
use prost::bytes::Bytes;

/// Longest device text that is kept, in bytes, since there may be many devices.
const TEXT_BYTES: usize = 200;

fn shortened(mut text: String) -> String {
    text.truncate(text.floor_char_boundary(TEXT_BYTES));
    text
}

impl wire::Offer {
    /// The offer of processors whose test render has this hash.
    pub fn of_processors(canary: Bytes) -> Self {
        Self {
            canary,
            ..Self::default()
        }
    }
}

impl From<&Offer> for wire::Offer {
    fn from(offer: &Offer) -> Self {
        Self {
            gpu_bits: offer.engine.gpu_bits(),
            canary: offer.canary.map(|hash| FileHash(hash).to_wire()).unwrap_or_default(),
            device: offer.device.clone().map(wire::Device::from),
        }
    }
}

/// `None`: the offer is for an engine that this program does not know.
impl TryFrom<wire::Offer> for Option<Offer> {
    type Error = WireError;
    fn try_from(offer: wire::Offer) -> Result<Self, WireError> {
        let canary = match offer.canary.is_empty() {
            true => None,
            false => Some(FileHash::from_wire(&offer.canary, "offers.canary")?.0),
        };
        let engine = EngineKind::of_gpu_bits(offer.gpu_bits);
        Ok(engine.map(|engine| Offer {
            engine,
            canary,
            device: offer.device.map(Device::from),
        }))
    }
}

impl From<Device> for wire::Device {
    fn from(device: Device) -> Self {
        let Device {
            name,
            kind,
            driver,
            memory,
        } = device;
        Self {
            name,
            kind,
            driver,
            memory,
        }
    }
}

impl From<wire::Device> for Device {
    fn from(device: wire::Device) -> Self {
        Self {
            name: shortened(device.name),
            kind: shortened(device.kind),
            driver: shortened(device.driver),
            memory: device.memory,
        }
    }
}

impl From<&Lack> for wire::Lack {
    fn from(lack: &Lack) -> Self {
        Self {
            gpu_bits: lack.engine.gpu_bits(),
            reason: lack.reason.clone(),
        }
    }
}

impl From<wire::Lack> for Option<Lack> {
    fn from(lack: wire::Lack) -> Self {
        Some(Lack {
            engine: EngineKind::of_gpu_bits(lack.gpu_bits)?,
            reason: shortened(lack.reason),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offers_come_back_as_they_were() {
        let device = Device {
            name: "Card".into(),
            kind: "discrete".into(),
            driver: "driver 1.2".into(),
            memory: Some(1 << 30),
        };
        let offer = |engine, canary, device| Offer { engine, canary, device };
        for offer in [
            offer(EngineKind::Cpu, Some([7; 32]), None),
            offer(EngineKind::Gpu, None, Some(device)),
        ] {
            let back = Option::<Offer>::try_from(wire::Offer::from(&offer));
            assert_eq!(back, Ok(Some(offer)));
        }
        let lack = Lack {
            engine: EngineKind::Gpu,
            reason: "no card".into(),
        };
        assert_eq!(Option::<Lack>::from(wire::Lack::from(&lack)), Some(lack));
    }

    #[test]
    fn what_is_not_known_is_no_offer_and_what_is_wrong_is_refused() {
        let of = |gpu_bits, bytes| wire::Offer {
            gpu_bits,
            canary: vec![1; bytes].into(),
            device: None,
        };
        assert_eq!(Option::<Offer>::try_from(of(999, 32)), Ok(None));
        let error = Option::<Offer>::try_from(of(0, 31)).unwrap_err();
        assert_eq!(error.to_string(), "offers.canary: 31 bytes; expected 32");
        let long = wire::Device {
            name: "é".repeat(200),
            ..wire::Device::default()
        };
        assert_eq!(Device::from(long).name, "é".repeat(100));
    }
}
