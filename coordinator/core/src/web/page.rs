//! The page and its pieces. Numbers, tables and the curve are made here, so that the page is complete without a script;
//! the script only replaces pieces with newer ones.

use super::layout::Page;
use super::{Asked, EXPOSURES, Web, curve, frames};
use crate::farm::{End, Event, EventKind, Progress, Unable};
use crate::html;
use crate::html::Html;
use crate::ledger::{WorkerState, WorkerView};
use crate::series::Series;
use crate::watch::picture::Picture;
use crate::watch::{Watch, heat, unix_time};
use axum::response::{IntoResponse, Response};
use beamfarm_image::job::{EngineKind, MAX_PASSES};
use beamfarm_image::view::white;
use beamfarm_proto::VERSION;
use std::time::{Duration, SystemTime};

/// The most workers and events on a page.
const WORKERS: usize = 200;
const EVENTS: usize = 60;
const TROUBLES: usize = 10;
/// Workers heard of within this time are shown as "now".
const RECENT: Duration = Duration::from_secs(15);

/// The job's state, as a symbol and in words.
struct Headline {
    shape: &'static str,
    words: String,
    /// CSS class.
    class: &'static str,
}

struct Row {
    name: String,
    device: Option<String>,
    threads: u32,
    passes: u64,
    rate: String,
    seen: String,
    audits: String,
    shape: &'static str,
    state: &'static str,
    class: &'static str,
    doing: String,
}

struct Line {
    time: String,
    kind: &'static str,
    text: String,
}

/// The pieces by place; `image` is the number of passes in the available picture.
pub(super) async fn pieces(series: &Series, watch: &Watch) -> Vec<(&'static str, String)> {
    let picture = watch.picture().await;
    let shown = picture.as_ref().map_or(0, |picture| picture.average.passes);
    let [state, curve, workers, failures, log] = texts(watch, picture.as_deref()).map(Html::into_string);
    let pieces = [
        ("state", state),
        ("image", shown.to_string()),
        ("curve", curve),
        ("workers", workers),
        ("failures", failures),
        ("log", log),
    ];
    let frames = frames::list(&series.frames()).map(|frames| ("frames", frames.into_string()));
    pieces.into_iter().chain(frames).collect()
}

fn views(watch: &Watch) -> Vec<(String, String)> {
    let layers = watch.farm().job().layers.iter();
    let layers = layers.map(|layer| (layer.to_string(), format!("layer {layer}")));
    let own = [("error", "map of the error"), ("false", "false colours")];
    let own = own.map(|(name, words)| (name.to_owned(), words.to_owned()));
    own.into_iter().chain(layers).collect()
}

/// The page.
pub(super) async fn page(web: &Web, asked: &Asked) -> Response {
    let watch = &*web.watch();
    let picture = watch.picture().await;
    let job = watch.farm().job();
    let progress = watch.farm().progress();
    let look = asked.view(watch);
    let page = Page {
        name: match watch.terms().title.as_str() {
            "" => "a job".into(),
            title => title.to_owned(),
        },
        job: watch.id().to_owned(),
        version: VERSION,
        scene: job.scene.to_string(),
        width: job.width,
        height: job.height,
        pieces: texts(watch, picture.as_deref()),
        frames: frames::list(&web.series.frames()),
        is_part: watch.terms().first_pass > 0,
        shown: picture.as_ref().map_or(0, |picture| picture.average.passes),
        exposure: look.exposure,
        lowest: *EXPOSURES.start(),
        highest: *EXPOSURES.end(),
        curve: look.transform.name(),
        white_balance: look.white_balance,
        coldest: *white::RANGE.start(),
        hottest: *white::RANGE.end(),
        view: asked.view.clone().unwrap_or_else(|| "image".into()),
        views: views(watch),
        scale: heat::scale(),
        done: asked.done,
        limit: if progress.limit < MAX_PASSES { progress.limit } else { 0 },
        is_over: web.series.is_over(),
        is_paused: progress.paused,
    };
    axum::response::Html(page.html().into_string()).into_response()
}

fn texts(watch: &Watch, picture: Option<&Picture>) -> [Html; 5] {
    let progress = watch.farm().progress();
    let events = watch.farm().events(0);
    let curve = curve::svg(&watch.curve());
    [
        state(watch, &progress, picture),
        curve.unwrap_or_else(|| {
            html!(
                "<p class=\"soft\">There is a curve as soon as the error is known at two times: from four passes on.</p>"
            )
        }),
        workers(&progress),
        failures(&progress, &events),
        log(&events),
    ]
}

fn headline(watch: &Watch, progress: &Progress) -> Headline {
    let headline = |shape, words: &str, class| Headline {
        shape,
        words: words.to_owned(),
        class,
    };
    match watch.farm().end() {
        Some(End::Complete) => headline("✓", "Complete", "good"),
        Some(End::Stopped) => headline("■", "Stopped", "still"),
        Some(End::Failed(failure)) => {
            let words = format!("Failed: pass {}: {}", failure.pass_index, failure.message);
            headline("✕", &words, "bad")
        }
        None if progress.paused => headline("❚❚", "Paused", "still"),
        None if progress.workers == 0 => match watch.farm().job().settings.engine {
            EngineKind::Cpu => headline("…", "Waiting for workers", "still"),
            engine => headline("…", &format!("Waiting for workers with the engine {engine}"), "still"),
        },
        None => headline("▶", "Rendering", "good"),
    }
}

fn state(watch: &Watch, progress: &Progress, picture: Option<&Picture>) -> Html {
    let headline = headline(watch, progress);
    // Rounded down, so that nothing looks finished before it is.
    let percent = (1000.0 * watch.fraction(progress)).floor() / 10.0;
    let rates = watch.rates();
    let over = watch.farm().end().is_some();
    let ends = match (over, watch.remaining(progress)) {
        (true, _) => "over".into(),
        (false, Some(left)) => format!("in about {}", roughly(left)),
        (false, None) => "not known yet".into(),
    };
    let error = match watch.curve().last() {
        Some(point) => format!("{} after {} passes", curve::percent(point.error), point.passes),
        None => "known from two passes on".into(),
    };
    let mut facts = vec![
        ("Ends", ends),
        ("Running for", running_for(watch)),
        ("Rate", format!("{:.2} passes/s", rates.passes)),
        ("Estimated error", error),
    ];
    facts.extend(picture.into_iter().flat_map(quality));
    facts.push(("Workers", progress.workers.to_string()));
    let engine = watch.farm().job().settings.engine;
    if engine != EngineKind::Cpu {
        facts.push(("Engine", engine.identity()));
    }
    if let Some(error) = watch.terms().target {
        facts.push(("Stops at", curve::percent(error)));
    }
    if let Some(time) = watch.terms().time {
        facts.push(("Time limit", roughly(time)));
    }
    let limit = match progress.limit {
        MAX_PASSES => None,
        limit => Some(html!(" of {limit}", limit = limit)),
    };
    let ahead = progress
        .passes
        .saturating_sub(progress.prefix.saturating_sub(watch.terms().first_pass));
    let ahead = (ahead > 0).then(|| html!(" <span class=\"soft\">and {ahead} beyond a gap</span>", ahead = ahead));
    let facts = facts.iter().map(|(name, value)| {
        html!(
            "\n<div><dt>{name}</dt><dd>{value}</dd></div>",
            name = name,
            value = value
        )
    });
    html!(
        r#"<div data-title="{percent:.0} % {words}">
<p class="headline {class}"><span class="shape" aria-hidden="true">{shape}</span> <strong>{words}</strong></p>
<progress max="100" value="{percent}" aria-label="Share of the job that is done">{percent} %</progress>
<p><b class="big">{percent} %</b> {prefix}{limit} passes{ahead}</p>
<dl class="facts">{facts}
</dl>
</div>"#,
        percent = percent,
        words = headline.words,
        class = headline.class,
        shape = headline.shape,
        prefix = progress.prefix,
        limit = limit,
        ahead = ahead,
        facts = facts.collect::<Html>(),
    )
}

/// More details of the picture's error.
fn quality(picture: &Picture) -> Vec<(&'static str, String)> {
    let mut facts = Vec::new();
    let Picture { average, noise, .. } = picture;
    if let Some(median) = noise.median {
        facts.push(("Error of lit blocks, median", curve::percent(median)));
    }
    if let Some(fireflies) = noise.fireflies {
        facts.push(("Fireflies", fireflies.to_string()));
    }
    if let Some(bias) = &average.bias {
        facts.push(("Bias", bias.to_string()));
        facts.extend(bias.tiles_in_words().map(|tiles| ("Tiles", tiles)));
    }
    facts
}

fn running_for(watch: &Watch) -> String {
    let now = roughly(watch.worked());
    match watch.farm().before() {
        Duration::ZERO => now,
        _ => format!(
            "{now}, {} with the time before it was resumed",
            roughly(watch.elapsed_in_all())
        ),
    }
}

fn workers(progress: &Progress) -> Html {
    html!(
        "{present}{unable}",
        present = present(progress),
        unable = unable(progress)
    )
}

/// Workers without the job's engine, the most recent first.
fn unable(progress: &Progress) -> Option<Html> {
    let one = |unable: &Unable| {
        html!(
            "\n<li><b>{name}</b> {reason} <span class=\"soft\">({times} ×)</span></li>",
            name = unable.name,
            reason = unable.reason,
            times = unable.times,
        )
    };
    let all: Vec<Html> = progress.unable.iter().rev().take(TROUBLES).map(one).collect();
    (!all.is_empty()).then(|| {
        html!(
            "\n<p>Cannot serve this job:</p>\n<ul class=\"counts\">{all}\n</ul>",
            all = all.into_iter().collect::<Html>()
        )
    })
}

fn present(progress: &Progress) -> Html {
    let mut views: Vec<&WorkerView> = progress.workers_seen.iter().collect();
    if views.is_empty() {
        return html!(
            "<p class=\"soft\">Nobody yet. On each machine that is to work: \
             <code>beamfarm worker --connect URL</code></p>"
        );
    }
    // Present workers first, each group in order of registration.
    views.sort_by_key(|view| matches!(view.state, WorkerState::Gone));
    let more = views.len().saturating_sub(WORKERS);
    let more = (more > 0).then(|| {
        html!(
            "\n<p class=\"soft\">and {more} more: <code>beamfarm status</code> lists them all.</p>",
            more = more
        )
    });
    let rows = views.into_iter().take(WORKERS).map(|view| row(view).html());
    html!(
        r#"<table>
<caption>{connected} connected</caption>
<thead><tr><th scope="col">Name</th><th scope="col">State</th><th scope="col">Threads</th><th scope="col">Passes</th><th scope="col">Rate</th><th scope="col">Last seen</th><th scope="col">Audits</th><th scope="col">Renders</th></tr></thead>
<tbody>{rows}
</tbody>
</table>{more}"#,
        connected = progress.workers,
        rows = rows.collect::<Html>(),
        more = more,
    )
}

impl Row {
    fn html(&self) -> Html {
        let device = self.device.as_ref();
        let device = device.map(|device| html!("<br><span class=\"soft\">{device}</span>", device = device));
        html!(
            r#"
<tr><th scope="row">{name}{device}</th><td data-label="State" class="{class}"><span><span aria-hidden="true">{shape}</span> {state}</span></td><td data-label="Threads">{threads}</td><td data-label="Passes">{passes}</td><td data-label="Rate">{rate}</td><td data-label="Last seen">{seen}</td><td data-label="Audits">{audits}</td><td data-label="Renders">{doing}</td></tr>"#,
            name = self.name,
            device = device,
            class = self.class,
            shape = self.shape,
            state = self.state,
            threads = self.threads,
            passes = self.passes,
            rate = self.rate,
            seen = self.seen,
            audits = self.audits,
            doing = self.doing,
        )
    }
}

fn row(view: &WorkerView) -> Row {
    let (shape, class) = match view.state {
        WorkerState::Working => ("●", "good"),
        WorkerState::Idle => ("○", "still"),
        WorkerState::BackingOff => ("◑", "still"),
        WorkerState::Gone => ("–", "soft"),
        WorkerState::ShutOut => ("✕", "bad"),
    };
    Row {
        name: view.name.clone(),
        device: view.device.as_ref().map(ToString::to_string),
        threads: view.threads,
        passes: view.passes,
        rate: match view.seconds_per_pass {
            Some(seconds) if seconds > 0.0 => format!("{:.2}/s", 1.0 / seconds),
            _ => "–".into(),
        },
        seen: match view.last_seen {
            seen if seen < RECENT => "now".into(),
            seen => format!("{} ago", roughly(seen)),
        },
        audits: match (view.audits_passed, view.audits_failed) {
            (0, 0) => "–".into(),
            (passed, 0) => format!("{passed} ✓"),
            (passed, failed) => format!("{passed} ✓ {failed} ✕"),
        },
        shape,
        state: view.state.as_str(),
        class,
        doing: match view.rendering {
            Some((block, _)) => block.to_string(),
            None => String::new(),
        },
    }
}

fn failures(progress: &Progress, events: &[Event]) -> Html {
    let counts = [
        (
            "leases ended without a result; their passes are handed out again",
            progress.lost_leases,
        ),
        ("attempts at a block of passes failed", progress.failures),
        ("deliveries were refused", progress.refused),
        (
            "blocks are in dispute: two workers delivered other bits",
            progress.divergent,
        ),
        (
            "passes were taken out again, because of who rendered them",
            progress.dropped,
        ),
    ];
    let is_trouble = |event: &&Event| {
        use EventKind::{Divergent, Dropped, Failed, Lost, Refused, ShutOut, Unable};
        matches!(
            event.kind,
            Divergent | Dropped | Failed | Lost | Refused | ShutOut | Unable
        )
    };
    let counts = counts.into_iter().filter(|(_, count)| *count > 0);
    let counts: Vec<Html> = counts
        .map(|(what, count)| html!("\n<li><b>{count}</b> {what}</li>", count = count, what = what))
        .collect();
    let troubles: Vec<Line> = events
        .iter()
        .rev()
        .filter(is_trouble)
        .take(TROUBLES)
        .map(line)
        .collect();
    if counts.is_empty() && troubles.is_empty() {
        return html!("<p class=\"soft\">None.</p>");
    }
    let counts = (!counts.is_empty()).then(|| {
        html!(
            "<ul class=\"counts\">{counts}\n</ul>\n",
            counts = counts.into_iter().collect::<Html>()
        )
    });
    html!("{counts}{troubles}", counts = counts, troubles = lines(&troubles))
}

fn log(events: &[Event]) -> Html {
    let all: Vec<Line> = events.iter().rev().take(EVENTS).map(line).collect();
    lines(&all).unwrap_or_else(|| html!("<p class=\"soft\">Nothing has happened yet.</p>"))
}

/// A list, if not empty.
fn lines(lines: &[Line]) -> Option<Html> {
    let items = lines.iter().map(|line| {
        html!(
            "\n<li><time>{time}</time> <b>{kind}</b> {text}</li>",
            time = line.time,
            kind = line.kind,
            text = line.text,
        )
    });
    let items: Html = items.collect();
    (!lines.is_empty()).then(|| html!("<ol class=\"lines\">{items}\n</ol>", items = items))
}

fn line(event: &Event) -> Line {
    Line {
        time: clock(event.time),
        kind: event.kind.as_str(),
        text: event.text.clone(),
    }
}

/// `14:07:32`, UTC.
fn clock(time: SystemTime) -> String {
    let seconds = unix_time(time).as_secs();
    let (hours, minutes) = (seconds / 3600 % 24, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

/// `40 s`, `3 min 20 s`, `2 h 5 min`, `4 d 3 h`.
fn roughly(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        s if s < 60 => format!("{s} s"),
        s if s < 3600 => format!("{} min {} s", s / 60, s % 60),
        s if s < 86_400 => format!("{} h {} min", s / 3600, s / 60 % 60),
        s => format!("{} d {} h", s / 86_400, s / 3600 % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::film::Film;
    use beamfarm_image::merge::{Node, TreeSum};
    use beamfarm_proto::{Device, WorkerId};

    #[test]
    fn names_of_workers_are_text() {
        let view = WorkerView {
            id: WorkerId(1),
            key: None,
            name: "<script>alert(1)</script>\" onload=\"x".into(),
            threads: 4,
            device: Some(Device {
                name: "<b>card</b>".into(),
                kind: "discrete".into(),
                driver: String::new(),
                memory: Some(3 << 29),
            }),
            passes: 12,
            seconds_per_pass: Some(0.25),
            last_seen: Duration::from_secs(1),
            audits_passed: 2,
            audits_failed: 1,
            state: WorkerState::ShutOut,
            rendering: None,
        };
        let progress = Progress {
            workers_seen: vec![view; WORKERS + 3],
            unable: vec![Unable {
                name: "<i>other</i>".into(),
                reason: "no <u>card</u>".into(),
                times: 7,
            }],
            ..Progress::default()
        };
        let text = workers(&progress).into_string();
        assert!(!text.contains("<script") && !text.contains("\" onload"), "{text}");
        assert!(text.contains("&#60;script&#62;alert(1)"), "{text}");
        assert!(
            text.contains("&#60;b&#62;card&#60;/b&#62;, discrete, 1.5 GiB"),
            "{text}"
        );
        assert!(
            text.contains("Cannot serve") && text.contains("no &#60;u&#62;card") && text.contains("(7 ×)"),
            "{text}"
        );
        assert!(text.contains("4.00/s") && text.contains("2 ✓ 1 ✕") && text.contains("shut out"));
        assert!(text.contains("3 more"), "{text}");
    }

    #[test]
    fn texts_of_events_are_text() {
        let event = Event {
            number: 0,
            time: SystemTime::UNIX_EPOCH + Duration::from_secs(86_400 + 3723),
            kind: EventKind::Failed,
            text: "<img src=x onerror=y>".into(),
        };
        let events = [event];
        let texts = [
            log(&events).into_string(),
            failures(&Progress::default(), &events).into_string(),
        ];
        for text in texts {
            assert!(text.contains("&#60;img") && !text.contains("<img"), "{text}");
            assert!(text.contains("01:02:03"));
        }
    }

    #[test]
    fn fireflies_and_bias_are_facts() {
        let mut sum = TreeSum::new(64, 32);
        for pass in 0..32u8 {
            let scale = 1.0 / f64::from(pass + 1);
            let mut film = Film::new(64, 32);
            // The left tile is biased; one pixel of the right one is an outlier.
            for (i, pixel) in film.pixels.iter_mut().enumerate() {
                let noise = f32::from((pass / 2 + pass) % 2) * 0.01;
                let bias = if i % 64 < 32 { 0.1 * scale as f32 } else { 0.0 };
                *pixel = [1.0 + noise + bias; 3];
            }
            // In one replication more often than in the other.
            film.pixels[40] = [if pass % 2 == 1 && pass != 3 { 300.0 } else { 0.0 }; 3];
            let leaf = Node::leaf(pass.into(), film).with_radius_scale(scale);
            sum.insert(leaf).unwrap();
        }
        let average = sum.average().unwrap();
        let picture = Picture {
            error: average.relative_standard_error(),
            noise: average.noise(),
            average,
        };
        let facts = quality(&picture);
        let names: Vec<&str> = facts.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["Error of lit blocks, median", "Fireflies", "Bias", "Tiles"]);
        assert!(facts[1].1.starts_with("1 pixel holds 99 % of the error"), "{facts:?}");
        assert!(
            facts[3].1.contains("1 of 2") && facts[3].1.ends_with("at (0, 0)"),
            "{facts:?}"
        );
    }

    #[test]
    fn no_failures_are_said_to_be_none() {
        let text = failures(&Progress::default(), &[]).into_string();
        assert!(text.contains("None"), "{text}");
        let progress = Progress {
            lost_leases: 3,
            ..Progress::default()
        };
        let text = failures(&progress, &[]).into_string();
        assert!(text.contains("3 leases") || text.contains("<b>3</b> leases"), "{text}");
    }

    #[test]
    fn times_are_short() {
        let roughly = |seconds| roughly(Duration::from_secs(seconds));
        assert_eq!(roughly(59), "59 s");
        assert_eq!(roughly(61), "1 min 1 s");
        assert_eq!(roughly(7260), "2 h 1 min");
        assert_eq!(roughly(90_000), "1 d 1 h");
    }
}
