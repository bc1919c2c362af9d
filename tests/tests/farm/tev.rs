//! The image in a tev that is absent, accepts what is sent, or goes away.

use crate::farm::harness::{Coordinator, HEIGHT, RawWorker, WIDTH, spec};
use beamfarm_coordinator::{End, tev};
use std::time::Duration;
use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(30);

/// A packet as tev understands it.
#[derive(Debug, PartialEq)]
enum Packet {
    Create {
        name: String,
        width: u32,
        height: u32,
        channels: Vec<String>,
    },
    Update {
        name: String,
        /// x, y, width, height.
        area: [u32; 4],
        /// Values of each channel, row by row.
        values: Vec<Vec<f32>>,
    },
}

struct Reader(std::vec::IntoIter<u8>);

impl Reader {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.0.next().unwrap())
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }
    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.bytes())
    }
    fn text(&mut self) -> String {
        let bytes: Vec<u8> = self.0.by_ref().take_while(|byte| *byte != 0).collect();
        String::from_utf8(bytes).unwrap()
    }
    fn texts(&mut self) -> Vec<String> {
        let count = self.u32();
        (0..count).map(|_| self.text()).collect()
    }
}

/// The next packet, read as tev's own `Ipc.cpp` does; `None` at the end.
async fn packet(stream: &mut TcpStream) -> Option<Packet> {
    let length = stream.read_u32_le().await.ok()?;
    let mut bytes = vec![0; length as usize - 4];
    stream.read_exact(&mut bytes).await.unwrap();
    let mut reader = Reader(bytes.into_iter());
    let [kind, _grab_focus] = reader.bytes();
    let name = reader.text();
    let packet = match kind {
        4 => {
            let (width, height) = (reader.u32(), reader.u32());
            let channels = reader.texts();
            Packet::Create {
                name,
                width,
                height,
                channels,
            }
        }
        6 => {
            let channels = reader.texts();
            let area = [0; 4].map(|_| reader.u32());
            let offsets: Vec<u64> = channels.iter().map(|_| reader.u64()).collect();
            let strides: Vec<u64> = channels.iter().map(|_| reader.u64()).collect();
            let rest: Vec<u8> = reader.0.by_ref().collect();
            let data: Vec<f32> = rest
                .chunks_exact(4)
                .map(|four| f32::from_le_bytes(four.try_into().unwrap()))
                .collect();
            let pixels = u64::from(area[2]) * u64::from(area[3]);
            let channel = |c: usize| {
                let place = |i| (offsets[c] + i * strides[c]) as usize;
                (0..pixels).map(|i| data[place(i)]).collect()
            };
            let values = (0..channels.len()).map(channel).collect();
            Packet::Update { name, area, values }
        }
        kind => panic!("packet of kind {kind}"),
    };
    assert_eq!(reader.0.len(), 0);
    Some(packet)
}

fn expected(coordinator: &Coordinator) -> Vec<Vec<f32>> {
    let pixels = coordinator.farm.average().unwrap().beauty.pixels;
    (0..3).map(|c| pixels.iter().map(|p| p[c]).collect()).collect()
}

#[tokio::test]
async fn tev_sees_each_image_and_the_last() {
    let coordinator = Coordinator::start(spec(2)).await;
    let worker = RawWorker::register(&coordinator).await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let shown = tokio::spawn(tev::show(coordinator.watch.clone(), address));
    let done = async {
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
        let (mut stream, _) = listener.accept().await.unwrap();
        let created = packet(&mut stream).await.unwrap();
        let name = coordinator.watch.id().to_owned();
        assert_eq!(
            created,
            Packet::Create {
                name: name.clone(),
                width: WIDTH,
                height: HEIGHT,
                channels: ["R", "G", "B"].map(str::to_owned).into(),
            }
        );
        let area = [0, 0, WIDTH, HEIGHT];
        let first = packet(&mut stream).await.unwrap();
        let values = expected(&coordinator);
        let update = |values| Packet::Update {
            name: name.clone(),
            area,
            values,
        };
        assert_eq!(first, update(values));
        let leased = worker.lease().await;
        worker.deliver(leased).await.unwrap();
        assert_eq!(coordinator.ended().await, End::Complete);
        let last = packet(&mut stream).await.unwrap();
        let values = expected(&coordinator);
        assert_eq!(last, update(values));
        assert_eq!(packet(&mut stream).await, None);
        shown.await.unwrap();
    };
    timeout(PATIENCE, done).await.unwrap();
}

#[tokio::test]
async fn a_tev_that_is_not_there_or_goes_away_does_not_matter() {
    let coordinator = Coordinator::start(spec(3)).await;
    let worker = RawWorker::register(&coordinator).await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let closed = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let nobody = closed.local_addr().unwrap().to_string();
    drop(closed);
    let watch = &coordinator.watch;
    let absent = tokio::spawn(tev::show(watch.clone(), nobody));
    let leaving = tokio::spawn(tev::show(watch.clone(), address));
    let done = async {
        let (stream, _) = listener.accept().await.unwrap();
        drop((stream, listener));
        for _ in 0..3 {
            let leased = worker.lease().await;
            worker.deliver(leased).await.unwrap();
        }
        assert_eq!(coordinator.ended().await, End::Complete);
        absent.await.unwrap();
        leaving.await.unwrap();
    };
    timeout(PATIENCE, done).await.unwrap();
}
