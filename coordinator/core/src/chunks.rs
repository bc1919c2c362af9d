//! Sending files to workers.

use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{CHUNK_BYTES, wire};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

/// The answer to a worker that fetches a file.
pub(crate) type FileStream = ReceiverStream<Result<wire::FileChunk, Status>>;

/// A file in chunks, sent as fast as the worker reads.
pub(crate) fn in_chunks(mut bytes: Bytes) -> FileStream {
    let (sender, receiver) = mpsc::channel(2);
    tokio::spawn(async move {
        while !bytes.is_empty() {
            let data = bytes.split_to(bytes.len().min(CHUNK_BYTES));
            // Fails when the worker is gone.
            if sender.send(Ok(wire::FileChunk { data })).await.is_err() {
                break;
            }
        }
    });
    ReceiverStream::new(receiver)
}
