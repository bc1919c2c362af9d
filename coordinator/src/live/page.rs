//! The live view's HTTP routes for browsers: the page, its socket, and pictures to download.

use super::socket;
use super::view::LiveView;
use axum::Router;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use beamfarm_coordinator::downloads;
use beamfarm_coordinator::revisions::{Content, Picture};
use beamfarm_coordinator::security::LOOK;
use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{ImageMeta, Maker, Names, encode_image};
use beamfarm_image::png::encode_png;
use beamfarm_proto::VERSION;
use std::sync::Arc;

/// The page's files.
macro_rules! page {
    ($($name:literal),*) => {
        [$((concat!("/", $name), include_str!(concat!("page/", $name)))),*]
    };
}

const FILES: [(&str, &str); 15] = page!(
    "look.css",
    "look.js",
    "dom.js",
    "eye.js",
    "field.js",
    "grip.js",
    "handles.js",
    "keys.js",
    "numbers.js",
    "panel.js",
    "picture.js",
    "scene.js",
    "sight.js",
    "steer.js",
    "wire.js"
);

/// The routes.
pub fn routes(view: Arc<LiveView>) -> Router {
    let mut routes = Router::new()
        .route(
            "/",
            get(|| file("text/html; charset=utf-8", include_str!("page/look.html"))),
        )
        .route(LOOK, get(socket::open))
        .route("/image.exr", get(exr))
        .route("/image.png", get(png));
    for (path, text) in FILES {
        let kind = match path.ends_with(".css") {
            true => "text/css; charset=utf-8",
            false => "text/javascript; charset=utf-8",
        };
        routes = routes.route(path, get(move || file(kind, text)));
    }
    routes.with_state(view)
}

async fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(CONTENT_TYPE, kind)], text)
}

/// A download named after the scene.
fn named(view: &LiveView, kind: &'static str, ending: &str, bytes: Vec<u8>) -> Response {
    let stem = view.args.scene.file_stem().unwrap_or_default().to_string_lossy();
    downloads::to_keep(kind, &format!("{}.{ending}", downloads::plain_name(&stem)), bytes)
}

fn picture(view: &LiveView) -> Option<Arc<Picture>> {
    view.revisions.pictures().borrow().clone()
}

/// The average as EXR with its metadata; unavailable while there are only sketches.
async fn exr(State(view): State<Arc<LiveView>>) -> Response {
    let (picture, job) = (picture(&view), view.revisions.job());
    let (number, meant) = {
        let bench = view.bench();
        (bench.number(), bench.meant().clone())
    };
    let of_now = picture.filter(|picture| picture.revision == number);
    let average = of_now.and_then(|picture| match &picture.content {
        Content::Average(average) => Some(average.clone()),
        Content::Sketch(_) => None,
    });
    let (Some(average), Some(job)) = (average, job) else {
        return downloads::none_yet();
    };
    let rest = view.rest().borrow().clone();
    let encoded = tokio::task::spawn_blocking(move || {
        let files = meant.files.into_iter();
        let bundle = Bundle {
            scene: meant.scene,
            files: files.map(|(path, file)| (path, file.bytes().to_vec())).collect(),
        };
        let meta = ImageMeta {
            scene: bundle.hash(),
            scene_file: None,
            maker: Maker::Passes(job.settings),
            render_seconds: rest.since.map_or(0.0, |since| since.elapsed().as_secs_f64()),
            version: VERSION.into(),
            layers: Vec::new(),
            standard_error: false,
            drops_photons: rest.drops_photons,
            names: Names::default(),
            empty_depth: None,
        };
        encode_image(&average, &meta)
    });
    match encoded.await {
        Ok(Ok(bytes)) => named(&view, "image/x-exr", "exr", bytes),
        Ok(Err(error)) => downloads::failed(error),
        Err(error) => downloads::failed(error),
    }
}

/// The displayed picture.
async fn png(State(view): State<Arc<LiveView>>) -> Response {
    let Some(picture) = picture(&view) else {
        return downloads::none_yet();
    };
    let shown = view.bench().view();
    let encoded = tokio::task::spawn_blocking(move || encode_png(picture.content.film(), shown));
    match encoded.await {
        Ok(Ok(bytes)) => named(&view, "image/png", "png", bytes),
        Ok(Err(error)) => downloads::failed(error),
        Err(error) => downloads::failed(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The served files are those that the page's modules import.
    #[test]
    fn modules_find_each_other() {
        let html = include_str!("page/look.html");
        let named = |path: &str| {
            let import = format!("from \".{path}\"");
            html.contains(&format!("\"{path}\"")) || FILES.iter().any(|(_, text)| text.contains(&import))
        };
        for (path, text) in FILES {
            assert!(named(path), "nothing names {path}");
            for import in text.split("from \"./").skip(1) {
                let name = import.split('"').next().unwrap();
                assert!(
                    FILES.iter().any(|(path, _)| path[1..] == *name),
                    "{path} imports {name}"
                );
            }
        }
    }
}
