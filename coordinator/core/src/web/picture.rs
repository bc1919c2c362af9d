//! The picture: to view, to download, and the values of its pixels.

use super::{Asked, Web};
use crate::downloads::{failed, none_yet, plain_name, to_keep};
use crate::watch::unix_time;
use axum::extract::{Query, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use beamfarm_image::exr::{ImageMeta, Maker, encode_image};
use beamfarm_image::film::Film;
use beamfarm_proto::VERSION;
use serde_json::{Map, Value, json};
use std::sync::Arc;
use std::time::SystemTime;

/// Header with the number of passes in a picture.
const PASSES: HeaderName = HeaderName::from_static("beamfarm-passes");

pub(super) async fn png(State(web): State<Arc<Web>>, Query(asked): Query<Asked>) -> Response {
    let watch = web.watch();
    let pictures = watch.pictures();
    let Some(picture) = pictures.of(asked.passes).await else {
        return none_yet();
    };
    let passes = picture.average.passes.to_string();
    match pictures.png(picture, asked.shown(&watch)).await {
        Ok(png) => ([(CONTENT_TYPE, "image/png".to_owned()), (PASSES, passes)], png).into_response(),
        Err(error) => failed(error),
    }
}

/// The image as the job would write it now, with its standard error and layers.
pub(super) async fn exr(State(web): State<Arc<Web>>, Query(asked): Query<Asked>) -> Response {
    let watch = web.watch();
    let Some(picture) = watch.pictures().of(asked.passes).await else {
        return none_yet();
    };
    let farm = watch.farm();
    let meta = ImageMeta {
        scene: farm.job().scene,
        scene_file: None,
        maker: Maker::Passes(farm.job().settings),
        render_seconds: watch.elapsed_in_all().as_secs_f64(),
        version: VERSION.into(),
        layers: farm.job().layers.clone(),
        standard_error: true,
        drops_photons: watch.terms().drops_photons,
        names: watch.terms().names.clone(),
        empty_depth: watch.terms().empty_depth,
    };
    let passes = picture.average.passes.to_string();
    let encoded = tokio::task::spawn_blocking(move || encode_image(&picture.average, &meta)).await;
    match encoded {
        Ok(Ok(exr)) => {
            let name = format!("{}-{passes}.exr", plain(&watch.terms().title));
            ([(PASSES, passes)], to_keep("image/x-exr", &name, exr)).into_response()
        }
        Ok(Err(error)) => failed(error),
        Err(error) => failed(error),
    }
}

/// A file's name for a picture with this title, which may have none.
fn plain(title: &str) -> String {
    match title.is_empty() {
        true => format!("beamfarm-{}", unix_time(SystemTime::now()).as_secs()),
        false => plain_name(title),
    }
}

/// A pixel's values by layer.
pub(super) async fn pixel(State(web): State<Arc<Web>>, Query(asked): Query<Asked>) -> Response {
    let watch = web.watch();
    let Some(picture) = watch.pictures().of(asked.passes).await else {
        return none_yet();
    };
    let average = &picture.average;
    let film = &average.beauty;
    if asked.x >= film.width || asked.y >= film.height {
        let size = format!("expected x below {} and y below {}\n", film.width, film.height);
        return (StatusCode::BAD_REQUEST, size).into_response();
    }
    let place = asked.y as usize * film.width as usize + asked.x as usize;
    let values = |film: &Film| Value::from(film.pixels[place].map(f64::from).to_vec());
    let mut layers = Map::new();
    for (layer, film) in watch.farm().job().layers.iter().zip(&average.layers) {
        layers.insert(layer.to_string(), values(film));
    }
    let text = json!({
        "passes": average.passes,
        "radiance": values(film),
        // Null where unknown.
        "standard_error": values(&average.standard_error),
        "layers": layers,
    });
    ([(CONTENT_TYPE, "application/json")], text.to_string()).into_response()
}
