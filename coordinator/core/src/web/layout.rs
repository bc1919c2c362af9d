//! The page's layout.

use crate::html;
use crate::html::Html;

/// The content of the page.
pub(super) struct Page {
    pub name: String,
    pub job: String,
    pub version: &'static str,
    pub scene: String,
    pub width: u32,
    pub height: u32,
    pub pieces: [Html; 5],
    /// The list of frames, if there are several jobs.
    pub frames: Option<Html>,
    /// Whether the job has no passes from zero on, and so no image.
    pub is_part: bool,
    /// Passes in the picture; zero if there is none.
    pub shown: u64,
    pub exposure: f32,
    pub lowest: f32,
    pub highest: f32,
    pub curve: &'static str,
    pub white_balance: f32,
    pub coldest: f32,
    pub hottest: f32,
    /// The name of the view shown.
    pub view: String,
    /// Other views: name and label.
    pub views: Vec<(String, String)>,
    pub scale: Vec<(String, u32)>,
    pub done: Option<bool>,
    /// Total number of passes, if limited.
    pub limit: u64,
    pub is_over: bool,
    pub is_paused: bool,
}

impl Page {
    pub(super) fn html(&self) -> Html {
        let [state, curve, workers, failures, log] = &self.pieces;
        html!(
            r##"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{name} – beamfarm</title>
<link rel="icon" href="/icon.svg">
<link rel="stylesheet" href="/page.css">
<noscript><meta http-equiv="refresh" content="10"></noscript>
<script src="/page.js" defer></script>
</head>
<body>
<header>
<h1>{name}</h1>
<p class="soft">{width} × {height} pixels · job {job} · beamfarm {version}</p>
<p id="connection" role="status"></p>
</header>
<main>
<section class="picture" aria-labelledby="picture">
<h2 id="picture">Image</h2>
{figure}
{scale}
{controls}
{steering}
</section>
<section class="state numbers" aria-label="Progress">
<div id="state">{state}</div>
</section>{frames}
<section class="against">
<h2>Error against time</h2>
<div id="curve">{curve}</div>
</section>
<section class="workers">
<h2 id="crew">Workers</h2>
<div id="workers" tabindex="0" role="group" aria-labelledby="crew">{workers}</div>
</section>
<section class="failures">
<h2 id="troubles">Failures</h2>
<div id="failures" tabindex="0" role="group" aria-labelledby="troubles">{failures}</div>
</section>
<section class="log">
<h2 id="events">Log</h2>
<p class="soft">Newest first; times are UTC.</p>
<div id="log" tabindex="0" role="group" aria-labelledby="events">{log}</div>
</section>
</main>
<footer><p class="soft"><code>Scene {scene}</code> · <a href="/metrics">metrics</a></p></footer>
</body>
</html>"##,
            name = self.name,
            width = self.width,
            height = self.height,
            job = self.job,
            version = self.version,
            figure = self.figure(),
            scale = self.scale(),
            controls = self.controls(),
            steering = self.steering(),
            state = state,
            frames = self.frames(),
            curve = curve,
            workers = workers,
            failures = failures,
            log = log,
            scene = self.scene,
        )
    }

    fn figure(&self) -> Html {
        let shown = match self.shown {
            0 => html!(
                r#"<img id="shown" width="{width}" height="{height}" alt="Nothing yet" hidden>"#,
                width = self.width,
                height = self.height,
            ),
            passes => html!(
                r#"<img id="shown" src="/image.png?passes={passes}&amp;exposure={exposure}&amp;view={view}&amp;curve={curve}&amp;white_balance={white}" width="{width}" height="{height}" alt="The image so far">"#,
                passes = passes,
                exposure = self.exposure,
                view = self.view,
                curve = self.curve,
                white = self.white_balance,
                width = self.width,
                height = self.height,
            ),
        };
        html!(
            r#"<figure>
<div id="frame" tabindex="0" aria-label="The image; scrolls when it is zoomed">
{shown}
<img id="held" alt="The picture that is compared with" hidden>
</div>
<figcaption><span id="caption">{caption}</span> <span id="value" class="soft"></span></figcaption>
</figure>"#,
            shown = shown,
            caption = self.caption(),
        )
    }

    /// What is shown, in words.
    fn caption(&self) -> String {
        if self.is_part {
            return "Passes from zero on make an image, and others render those".into();
        }
        let Some(last) = self.shown.checked_sub(1) else {
            return "No pass is complete yet".into();
        };
        if self.view == "error" {
            return format!("Error of passes 0 to {last}");
        }
        let mut caption = format!("Passes 0 to {last} at {} EV", self.exposure);
        if self.white_balance != 6500.0 {
            caption += &format!(", {} K", self.white_balance);
        }
        if self.curve != "standard" {
            caption += &format!(", {}", self.curve);
        }
        caption
    }

    fn scale(&self) -> Html {
        let fields = self.scale.iter().map(|(colour, x)| {
            html!(
                "\n<rect x=\"{x}\" y=\"0\" width=\"6\" height=\"14\" fill=\"{colour}\"/>",
                x = x,
                colour = colour
            )
        });
        html!(
            r#"<div id="scale" class="scale"{hidden}>
<svg viewBox="0 0 320 34" role="img" aria-label="Scale of the error map, from 0.1 % dark to 100 % bright">{fields}
<text x="0" y="30">0.1 %</text><text x="107" y="30" text-anchor="middle">1 %</text><text x="213" y="30" text-anchor="middle">10 %</text><text x="320" y="30" text-anchor="end">100 %</text>
</svg>
<p class="soft">Standard error, relative to the mean of 8 × 8 pixels. Brighter is worse.</p>
</div>"#,
            hidden = Html::when(self.view != "error", " hidden"),
            fields = fields.collect::<Html>(),
        )
    }

    fn controls(&self) -> Html {
        let views = self.views.iter().map(|(name, words)| {
            html!(
                "<option value=\"{name}\"{selected}>{words}</option>",
                name = name,
                selected = Html::when(self.view == *name, " selected"),
                words = words,
            )
        });
        let curves = ["standard", "filmic", "agx"].map(|name| {
            html!(
                "<option{selected}>{name}</option>",
                selected = Html::when(self.curve == name, " selected"),
                name = name,
            )
        });
        html!(
            r#"<form id="controls" method="get" action="/">
<label>Show <select name="view" id="view"><option value="image">image</option>{views}</select></label>
<label class="wide">Exposure <button type="button" id="darker" aria-label="Darker by a quarter of a stop" hidden>−</button><input type="range" name="exposure" id="exposure" min="{lowest}" max="{highest}" step="0.25" value="{exposure}"><button type="button" id="brighter" aria-label="Brighter by a quarter of a stop" hidden>+</button> <output id="stops" for="exposure">{exposure} EV</output></label>
<label>Curve <select name="curve" id="tone">{curves}</select></label>
<label>White <input type="number" name="white_balance" id="white" min="{coldest}" max="{hottest}" step="100" value="{white}"> K</label>
<label id="zooming" hidden>Zoom <select id="zoom"><option value="fit" selected>fit</option><option value="1">100 %</option><option value="2">200 %</option><option value="4">400 %</option><option value="8">800 %</option><option value="free" hidden>free</option></select></label>
<button id="apply">Show</button>
</form>
<form id="wiping" hidden><button type="button" id="hold">Hold this picture</button> <label>or one of yours <input type="file" id="reference" accept="image/png,image/jpeg"></label>
<label class="wide" id="wipe-row" hidden>Wipe <input type="range" id="wipe" min="0" max="100" value="50"></label></form>"#,
            views = views.collect::<Html>(),
            lowest = self.lowest,
            highest = self.highest,
            exposure = self.exposure,
            curves = curves.into_iter().collect::<Html>(),
            coldest = self.coldest,
            hottest = self.hottest,
            white = self.white_balance,
        )
    }

    fn steering(&self) -> Html {
        html!(
            r#"<p id="taking"><a id="exr" href="/image.exr" download>Download EXR</a> <a id="png" href="/image.png" download="{name}.png">Download PNG</a></p>
<form id="steering" method="post" action="/write"{over}><button>Write the image now</button>
<button formaction="/pause" id="pause"{paused}>Pause</button><button formaction="/resume" id="resume"{running}>Resume</button>
<button formaction="/cancel" id="cancel">End with what is there</button>
<label id="extending" hidden>Passes <input type="number" id="passes" min="1" step="1" value="{limit}"><button type="button" id="extend">Extend</button></label></form>
<p><span id="said" role="status">{said}</span></p>"#,
            name = self.name,
            over = Html::when(self.is_over, " hidden"),
            paused = Html::when(self.is_paused, " hidden"),
            running = Html::when(!self.is_paused, " hidden"),
            limit = self.limit,
            said = match self.done {
                Some(true) => "✓ Done.",
                Some(false) => "✕ Not done; the log says why.",
                None => "",
            },
        )
    }

    fn frames(&self) -> Option<Html> {
        let frames = self.frames.as_ref()?;
        Some(html!(
            r#"
<section class="frames">
<h2 id="several">Frames</h2>
<div id="frames" tabindex="0" role="group" aria-labelledby="several">{frames}</div>
</section>"#,
            frames = frames,
        ))
    }
}
