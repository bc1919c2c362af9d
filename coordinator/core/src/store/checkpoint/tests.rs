use super::*;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::io::Cursor;

const SHAPE: Shape = Shape {
    width: 5,
    height: 3,
    layers: LayerCounts { films: 2, mattes: 1 },
    first_pass: 0,
    digest: [7; 32],
};

fn film(salt: u64) -> Film {
    let mut film = Film::new(5, 3);
    for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
        *value = 1.0 / (1 + i as u64 + 17 * salt) as f32;
    }
    film
}

pub fn checkpoint(passes: impl IntoIterator<Item = u64>) -> Checkpoint {
    let mut sum = SHAPE.empty_sum();
    for pass in passes {
        let leaf = Node::leaf(pass, film(pass))
            .with_layers(vec![film(100 + pass), film(200 + pass)])
            .with_mattes(vec![Matte::leaf(&[3, 0, 7 + pass as u32, 0, 1].repeat(3))]);
        sum.insert(leaf.with_radius_scale(1.0 / (pass + 1) as f64)).unwrap();
        while sum.fence().is_some_and(|fence| fence <= sum.prefix()) {
            sum.lift_fence();
        }
    }
    let mut errors = Errors::UNKNOWN;
    errors.percentiles[3] = 0.25;
    Checkpoint {
        number: 3,
        sum,
        tested: vec![(2, errors), (3, Errors::UNKNOWN)],
        stats: PassStats {
            paths: 1,
            beams: 2,
            beam_bytes: 3,
            surface_photons: 4,
            beam_evaluations: 5,
            non_finite: 6,
        },
        seconds: 1.5,
        ledger: 0,
    }
}

fn bytes(checkpoint: &Checkpoint) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    checkpoint.write(&SHAPE.digest, &mut file).unwrap();
    file.into_inner()
}

fn read(bytes: &[u8]) -> Result<Checkpoint, Damage> {
    Checkpoint::read(&SHAPE, Cursor::new(bytes))
}

#[test]
fn what_was_written_is_read() {
    for passes in [vec![], vec![0], (0..7).collect(), vec![9, 0, 1, 4]] {
        let checkpoint = Checkpoint {
            ledger: 77,
            ..checkpoint(passes)
        };
        let again = read(&bytes(&checkpoint)).unwrap();
        assert_eq!(
            again.sum.nodes().collect::<Vec<_>>(),
            checkpoint.sum.nodes().collect::<Vec<_>>()
        );
        assert_eq!(again.sum.fence(), checkpoint.sum.fence());
        assert_eq!(again.tested, checkpoint.tested);
        assert_eq!(again.stats, checkpoint.stats);
        assert_eq!((again.number, again.seconds, again.ledger), (3, 1.5, 77));
    }
}

#[test]
fn other_jobs_are_refused() {
    let bytes = bytes(&checkpoint(0..3));
    let shape = Shape {
        digest: [8; 32],
        ..SHAPE
    };
    let error = Checkpoint::read(&shape, Cursor::new(bytes)).unwrap_err();
    assert_eq!(error.to_string(), "it belongs to another job");
}

/// A disk with room for a limited number of bytes.
struct Full(Cursor<Vec<u8>>, usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let room = self.1.saturating_sub(self.0.position() as usize);
        match room {
            0 if !bytes.is_empty() => Err(io::ErrorKind::StorageFull.into()),
            _ => self.0.write(&bytes[..bytes.len().min(room)]),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Full {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(20), ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn any_changed_byte_is_found(place: prop::sample::Index, change in 1u8..) {
        let mut bytes = bytes(&checkpoint([0, 1, 2, 5]));
        let place = place.index(bytes.len());
        bytes[place] ^= change;
        prop_assert!(read(&bytes).is_err(), "byte {}", place);
    }

    #[test]
    fn any_other_length_is_found(length: prop::sample::Index, more in 1usize..100) {
        let mut bytes = bytes(&checkpoint([0, 1, 2, 5]));
        prop_assert!(read(&bytes[..length.index(bytes.len())]).is_err());
        bytes.resize(bytes.len() + more, 0);
        prop_assert!(read(&bytes).is_err());
    }

    #[test]
    fn a_full_disk_is_an_error_wherever_it_happens(room: prop::sample::Index) {
        let checkpoint = checkpoint([0, 1, 2, 5]);
        let room = room.index(bytes(&checkpoint).len());
        let mut disk = Full(Cursor::new(Vec::new()), room);
        let error = checkpoint.write(&SHAPE.digest, &mut disk).unwrap_err();
        prop_assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        prop_assert!(read(&disk.0.into_inner()).is_err());
    }
}
