//! Shows the image in [tev](https://github.com/Tom94/tev) through its display protocol: little-endian packets over TCP,
//! two kinds of which are used. A packet starts with its length (u32, including itself) and its kind (u8); strings end
//! with a zero byte.
//!
//! If tev is missing or goes away, the job is unaffected.

use crate::farm::Farm;
use crate::watch::Watch;
use beamfarm_image::film::Film;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};
use tracing::{info, warn};

/// Time between images, and between attempts to reach tev.
const PAUSE: Duration = Duration::from_secs(2);
const RETRY: Duration = Duration::from_secs(10);
/// Time for tev to take an image.
const PATIENCE: Duration = Duration::from_secs(20);
/// Kinds of packets.
const CREATE_IMAGE: u8 = 4;
const UPDATE_IMAGE_V3: u8 = 6;
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Show the image of the complete passes in the tev at this address (`host:port`) whenever it changes, until the job
/// ends, including the final image.
pub async fn show(watch: Arc<Watch>, address: String) {
    let mut reached = true;
    loop {
        let farm = watch.farm().clone();
        match connect(&address).await {
            Ok(mut stream) => {
                reached = true;
                info!("showing the image in tev at {address}");
                match feed(&watch, &mut stream).await {
                    Ok(()) => return,
                    Err(error) => warn!("tev at {address} went away: {error}"),
                }
            }
            Err(error) if reached => {
                warn!("cannot reach tev at {address}: {error}; trying again from time to time");
                reached = false;
            }
            Err(_) => {}
        }
        if ended_within(&farm, RETRY).await {
            return;
        }
    }
}

async fn connect(address: &str) -> io::Result<TcpStream> {
    timeout(PATIENCE, TcpStream::connect(address))
        .await
        .map_err(io::Error::from)?
}

/// Send images until the job has ended and its final image is sent.
async fn feed(watch: &Watch, stream: &mut TcpStream) -> io::Result<()> {
    let name = watch.id();
    let mut sent = 0;
    loop {
        let over = watch.farm().end().is_some();
        if let Some(picture) = watch.picture().await
            && picture.average.passes != sent
        {
            let film = &picture.average.beauty;
            let mut packets = Vec::new();
            if sent == 0 {
                packets = create(name, film)?;
            }
            packets.extend(update(name, film)?);
            timeout(PATIENCE, stream.write_all(&packets))
                .await
                .map_err(io::Error::from)??;
            sent = picture.average.passes;
        }
        if over {
            return stream.shutdown().await;
        }
        ended_within(watch.farm(), PAUSE).await;
    }
}

async fn ended_within(farm: &Farm, time: Duration) -> bool {
    tokio::select! {
        _ = farm.ended() => true,
        () = sleep(time) => false,
    }
}

/// Packet for a new, black image.
fn create(name: &str, film: &Film) -> io::Result<Vec<u8>> {
    let mut packet = begin(CREATE_IMAGE, true, name);
    packet.extend(film.width.to_le_bytes());
    packet.extend(film.height.to_le_bytes());
    packet.extend((CHANNELS.len() as u32).to_le_bytes());
    CHANNELS.iter().for_each(|channel| text(&mut packet, channel));
    finish(packet)
}

/// Packet for all pixels of an image: rows from the top, channels interleaved.
fn update(name: &str, film: &Film) -> io::Result<Vec<u8>> {
    let mut packet = begin(UPDATE_IMAGE_V3, false, name);
    packet.reserve(12 * film.pixels.len() + 100);
    packet.extend((CHANNELS.len() as u32).to_le_bytes());
    CHANNELS.iter().for_each(|channel| text(&mut packet, channel));
    for number in [0, 0, film.width, film.height] {
        packet.extend(number.to_le_bytes());
    }
    // Channel offsets, then strides.
    for number in [0u64, 1, 2, 3, 3, 3] {
        packet.extend(number.to_le_bytes());
    }
    for value in film.pixels.iter().flatten() {
        packet.extend(value.to_le_bytes());
    }
    finish(packet)
}

fn begin(kind: u8, grab_focus: bool, name: &str) -> Vec<u8> {
    let mut packet = vec![0, 0, 0, 0, kind, grab_focus.into()];
    text(&mut packet, name);
    packet
}

fn text(packet: &mut Vec<u8>, text: &str) {
    packet.extend(text.bytes().filter(|byte| *byte != 0));
    packet.push(0);
}

fn finish(mut packet: Vec<u8>) -> io::Result<Vec<u8>> {
    let too_large = |_| io::Error::other("the image is too large for tev's protocol");
    let length = u32::try_from(packet.len()).map_err(too_large)?;
    packet[..4].copy_from_slice(&length.to_le_bytes());
    Ok(packet)
}
