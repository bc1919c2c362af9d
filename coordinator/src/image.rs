//! The image of a job, written at its end and on request.

use crate::failure::Failure;
use crate::history::History;
use crate::output::Output;
use beamfarm_coordinator::Farm;
use beamfarm_image::exr::{ImageMeta, Maker};
use beamfarm_image::merge::Average;
use beamfarm_image::view::View;
use beamfarm_proto::VERSION;
use std::sync::Arc;
use tracing::Span;

/// An image that was written.
pub struct Written {
    pub average: Average,
    pub meta: ImageMeta,
}

/// Write the image of the complete prefix while the job goes on. Returns what was written, for display.
pub async fn write_now(farm: &Arc<Farm>, output: &Output, view: View) -> Result<String, Failure> {
    match write(farm, output, view, None).await? {
        Some(Written { average, .. }) => Ok(format!("wrote {} with {} passes", output.exr.display(), average.passes)),
        None => Err(Failure::nothing("no pass is complete")),
    }
}

/// Write the image of the complete prefix and the last row of its history; nothing before the first pass.
pub async fn write(
    farm: &Arc<Farm>,
    output: &Output,
    view: View,
    history: Option<Arc<History>>,
) -> Result<Option<Written>, Failure> {
    let (farm, output) = (farm.clone(), output.clone());
    let span = Span::current();
    let write = move || {
        let _job = span.entered();
        let Some(average) = farm.average() else {
            return Ok(None);
        };
        let meta = ImageMeta {
            scene: farm.job().scene,
            scene_file: output.scene_file.clone(),
            maker: Maker::Passes(farm.job().settings),
            render_seconds: farm.snapshot().seconds,
            version: VERSION.into(),
            layers: farm.job().layers.clone(),
            standard_error: output.standard_error,
            drops_photons: output.drops_photons,
            names: output.names.clone(),
            empty_depth: output.empty_depth,
        };
        output.write(&average, &meta, view)?;
        if let Some(history) = history {
            history.finish(&average, &farm.progress())?;
        }
        Ok(Some(Written { average, meta }))
    };
    tokio::task::spawn_blocking(write).await.map_err(Failure::io)?
}
