//! The page that shows a job, with `/metrics` and `/healthz` for machines. Everything is compiled in; nothing is loaded
//! from elsewhere.

mod buttons;
mod curve;
mod frames;
mod layout;
mod live;
mod metrics;
mod page;
mod picture;
mod thumbnail;

use crate::security::{CANCEL, ENTER, ENTER_SCRIPT, EXTEND, HEALTH, PAUSE, RESUME, WRITE};
use crate::series::Series;
use crate::watch::Watch;
use crate::watch::shown::Shown;
use axum::Router;
use axum::extract::{Query, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderName, HeaderValue, Request};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use beamfarm_image::view::{View, ViewTransform, white};
use live::Live;
use serde::Deserialize;
use std::sync::Arc;

/// Allows only what this server sends and what the script makes of it. No page may frame it, and no form may post
/// elsewhere.
const POLICY: &str = "default-src 'none'; img-src 'self' blob:; style-src 'self'; script-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
/// Range of exposures, in stops.
const EXPOSURES: std::ops::RangeInclusive<f32> = -20.0..=20.0;

/// Shared by the handlers.
pub(crate) struct Web {
    series: Arc<Series>,
    live: Live,
}

impl Web {
    /// The job shown: the first in line.
    fn watch(&self) -> Arc<Watch> {
        self.series.current()
    }
}

/// The page's routes.
pub(crate) fn routes(series: Arc<Series>) -> Router {
    let web = Arc::new(Web {
        live: Live::new(series.clone()),
        series,
    });
    let page = Router::new()
        .route("/", get(show))
        .route("/image.png", get(picture::png))
        .route("/image.exr", get(picture::exr))
        .route("/pixel", get(picture::pixel))
        .route("/frame.png", get(frames::png))
        .route("/thumbnail.png", get(frames::thumbnail))
        .route("/live", get(live::stream))
        .route(WRITE, post(buttons::write))
        .route(PAUSE, post(buttons::pause))
        .route(RESUME, post(buttons::resume))
        .route(EXTEND, post(buttons::extend))
        .route(CANCEL, post(buttons::cancel))
        .route(
            "/page.css",
            get(|| file("text/css; charset=utf-8", include_str!("page.css"))),
        )
        .route(
            "/page.js",
            get(|| file("text/javascript; charset=utf-8", include_str!("page.js"))),
        )
        .route("/metrics", get(metrics::serve))
        .with_state(web);
    around(page)
}

/// Adds to a page what every page here has: the entrance for links with a token, the icon, and headers that restrict
/// the browser.
pub(crate) fn around(page: Router) -> Router {
    page.route(
        ENTER,
        get(|| file("text/html; charset=utf-8", include_str!("enter.html"))),
    )
    .route(
        ENTER_SCRIPT,
        get(|| file("text/javascript; charset=utf-8", include_str!("enter.js"))),
    )
    .route("/icon.svg", get(|| file("image/svg+xml", include_str!("icon.svg"))))
    .route(HEALTH, get(|| file("text/plain; charset=utf-8", "ok\n")))
    .layer(from_fn(harden))
}

async fn harden(request: Request<axum::body::Body>, next: Next) -> Response {
    let mut response = next.run(request).await;
    for (name, value) in [
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(CONTENT_TYPE, kind)], text)
}

/// Query parameters of a page.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct Asked {
    /// Exposure, stops.
    exposure: Option<String>,
    /// `error` for the map of the error, `false` for luminance in false colours, or the name of a layer.
    view: Option<String>,
    /// Display curve: `standard`, `filmic` or `agx`.
    curve: Option<String>,
    /// White balance, kelvin.
    white_balance: Option<String>,
    passes: Option<u64>,
    /// The result of a button's action.
    done: Option<bool>,
    /// Pixel coordinates.
    x: u32,
    y: u32,
}

impl Asked {
    /// Exposure, stops. Invalid values are ignored.
    fn exposure(&self, watch: &Watch) -> f32 {
        let asked = self.exposure.as_deref().and_then(|text| text.parse().ok());
        let exposure: f32 = asked
            .filter(|stops: &f32| stops.is_finite())
            .unwrap_or(watch.terms().view.exposure);
        exposure.clamp(*EXPOSURES.start(), *EXPOSURES.end())
    }

    /// How radiance is displayed, likewise; by default as in the job's PNG.
    fn view(&self, watch: &Watch) -> View {
        let job = watch.terms().view;
        let white_balance = self.white_balance.as_deref().and_then(|text| text.parse().ok());
        View {
            transform: self
                .curve
                .as_deref()
                .and_then(ViewTransform::named)
                .unwrap_or(job.transform),
            // Rounded to the slider's step, so that returning to a value gives the same view.
            exposure: (100.0 * self.exposure(watch)).round() / 100.0,
            white_balance: white_balance
                .filter(|kelvin| white::RANGE.contains(kelvin))
                .unwrap_or(job.white_balance),
        }
    }

    fn shown(&self, watch: &Watch) -> Shown {
        let view = self.view(watch);
        let asked = self.view.as_deref().unwrap_or_default();
        match asked {
            "error" => Shown::Error,
            "false" => Shown::FalseColour {
                exposure: view.exposure,
            },
            _ => {
                let mut layers = watch.farm().job().layers.iter();
                let place = layers.position(|layer| layer.to_string() == asked);
                match place {
                    Some(place) => Shown::Layer { place, view },
                    None => Shown::Beauty(view),
                }
            }
        }
    }
}

async fn show(State(web): State<Arc<Web>>, Query(asked): Query<Asked>) -> Response {
    page::page(&web, &asked).await
}
