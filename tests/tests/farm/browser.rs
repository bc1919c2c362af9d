//! The page in a real browser: headless Chromium over its DevTools protocol.

use crate::farm::harness::{Coordinator, RawWorker, film, free_port, leaf, spec};
use beamfarm_coordinator::Timing;
use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::security::Security;
use beamfarm_harness::browser::Browser;
use beamfarm_image::exr::encode_block;
use beamfarm_proto::Token;
use serde_json::json;
use std::path::Path;
use std::time::Duration;

async fn deliver(worker: &RawWorker, passes: u64) {
    let mut delivered = 0;
    while delivered < passes {
        let leased = worker.lease().await;
        let block = leased.1;
        let nodes = block.passes().map(|pass| leaf(pass, film(pass)));
        let node = nodes.reduce(|a, b| beamfarm_image::merge::Node::join(a, b).unwrap());
        let bytes = encode_block(&node.unwrap(), &worker.meta(block), &[]).unwrap();
        worker.submit(leased, bytes).await.unwrap();
        delivered += block.len();
    }
}

const SET: &str = "(id, value) => {
    const input = document.getElementById(id);
    input.value = value;
    input.dispatchEvent(new Event('input'));
}";

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn the_image_changes_and_the_numbers_move() {
    let coordinator = Coordinator::start(spec(6)).await;
    let worker = RawWorker::register(&coordinator).await;
    let _attendance = worker.attend().await;
    let mut page = Browser::open(&coordinator.url());
    let state = |text: &str| format!("document.getElementById('state')?.innerText.includes('{text}') ?? false");
    let shows = |passes: u64| {
        format!(
            "document.getElementById('shown')?.dataset.passes === '{passes}' && document.getElementById('shown').complete"
        )
    };
    page.wait_for(&state("0 of 6 passes"));
    deliver(&worker, 2).await;
    page.wait_for(&state("2 of 6 passes"));
    page.wait_for(&shows(2));
    let (mean, first) = page.picture();
    deliver(&worker, 2).await;
    page.wait_for(&state("4 of 6 passes"));
    page.wait_for(&shows(4));
    let (_, second) = page.picture();
    assert_ne!(first, second);
    let percent = page.evaluate("document.querySelector('progress').value");
    assert_eq!(percent, json!(66.6));
    let title = page.evaluate("document.title");
    assert!(
        title.as_str().unwrap().starts_with("67 % Rendering") || title.as_str().unwrap().starts_with("66 % Rendering"),
        "{title}"
    );

    // The slider, the map of the error, and the zoom.
    page.evaluate(&format!("({SET})('exposure', '-6')"));
    page.wait_for("document.getElementById('caption').innerText.includes('-6 EV')");
    let (darker, _) = page.picture();
    assert!(darker < 0.5 * mean, "{darker} {mean}");
    page.evaluate(&format!("({SET})('view', 'error')"));
    page.wait_for("document.getElementById('caption').innerText.startsWith('Error of passes 0 to 3')");
    assert_eq!(page.evaluate("document.getElementById('scale').hidden"), json!(false));
    page.evaluate(&format!("({SET})('zoom', '4')"));
    assert_eq!(
        page.evaluate("document.getElementById('shown').clientWidth"),
        json!(160)
    );

    page.evaluate(&format!("({SET})('view', 'false')"));
    page.wait_for("document.getElementById('caption').innerText.includes('false colours at -6 EV')");
    page.evaluate("document.getElementById('brighter').click()");
    page.wait_for("document.getElementById('caption').innerText.includes('at -5.75 EV')");

    page.wait_for("document.querySelectorAll('#workers .rates polyline').length === 1");

    // The wheel zooms to the point under it, and the page shows the value of the pixel there.
    page.mouse("mouseMoved", 0.0);
    page.wait_for("/Pixel [0-9]+, [0-9]+: .* ± /.test(document.getElementById('value').innerText)");
    let place = |page: &mut Browser| page.evaluate("document.getElementById('value').innerText.split(':')[0]");
    let before = place(&mut page);
    page.mouse("mouseWheel", -400.0);
    page.wait_for("document.getElementById('shown').clientWidth === 320");
    page.mouse("mouseMoved", 0.0);
    assert_eq!(place(&mut page), before);

    // A held picture stays next to those that come.
    page.evaluate("document.getElementById('hold').click()");
    page.wait_for("document.getElementById('held').naturalWidth === 40");
    // The job obeys the page.
    page.evaluate("document.getElementById('pause').click()");
    page.wait_for(&state("Paused"));
    page.evaluate("document.getElementById('resume').click()");
    page.wait_for(&state("Rendering"));
    page.evaluate("document.getElementById('passes').value = 7");
    page.evaluate("document.getElementById('extend').click()");
    page.wait_for(&state("4 of 7 passes"));
    deliver(&worker, 1).await;

    deliver(&worker, 2).await;
    page.wait_for(&state("Complete"));
    page.wait_for("document.getElementById('connection').innerText.includes('is over')");
    page.wait_for(&shows(7));
    assert_eq!(
        page.evaluate("document.querySelectorAll('#curve circle').length > 1"),
        json!(true)
    );
    assert_eq!(page.wrongs(), json!([]));
}

/// The link that `render` prints: its token stands where it reaches neither server nor log.
#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn a_link_opens_the_page() {
    const TOKEN: &str = "a-token-of-the-job";
    let security = Security {
        token: Some(Token::parse(TOKEN).unwrap()),
        ..Security::default()
    };
    let doors = (security, Limits::default());
    let timing = Timing::default();
    let coordinator = Coordinator::start_behind(free_port(), spec(6), timing, doors).await;
    let url = coordinator.url();
    let mut page = Browser::open(&format!("{url}/enter#wrong-token-of-a-job"));
    page.wait_for("document.body?.innerText.includes('opens nothing any more') ?? false");
    let mut page = Browser::open(&format!("{url}/enter#{TOKEN}"));
    page.wait_for("document.getElementById('state')?.innerText.includes('0 of 6 passes') ?? false");
    // Everything else arrives as well, including the pause.
    coordinator.farm.pause(true);
    page.wait_for("document.getElementById('state').innerText.includes('Paused')");
    assert_eq!(page.evaluate("location.href"), json!(format!("{url}/")));
    assert_eq!(page.wrongs(), json!([]));
}

/// Text whose contrast with its background is below what people need, and the contrast (WCAG 2.2, 1.4.3).
const PALE: &str = "(() => {
    const parse = (text) => (text.match(/[0-9.]+/g) ?? []).map(Number);
    const luminance = ([r, g, b]) => [r, g, b]
        .map((v) => v / 255)
        .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
    const ground = (element) => {
        for (let at = element; at; at = at.parentElement) {
            const colour = parse(getComputedStyle(at).backgroundColor);
            if (colour.length === 3 || colour[3] === 1) return colour;
        }
        return [255, 255, 255];
    };
    const found = [];
    for (const element of document.body.querySelectorAll('*')) {
        const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
        if (!own || element.disabled || element.tagName === 'NOSCRIPT' || !element.getClientRects().length) continue;
        const style = getComputedStyle(element);
        const ink = element.ownerSVGElement ? style.fill : style.color;
        const [a, b] = [luminance(parse(ink)), luminance(ground(element))];
        const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        if (!(contrast >= 4.5)) found.push(`${element.textContent.trim().slice(0, 40)}: ${contrast}`);
    }
    return found;
})()";

/// Controls that are too small for a finger, on a phone.
const SMALL: &str = "[...document.querySelectorAll('button, select, input')]
    .map((element) => [element.id || element.textContent, element.getBoundingClientRect().height])
    .filter(([, height]) => height > 0 && height < 44)";

/// Text that is too small to read.
const TINY: &str = "[...document.querySelectorAll('svg text')]
    .map((text) => text.getScreenCTM().a * parseFloat(getComputedStyle(text).fontSize))
    .filter((size) => size > 0 && size < 10.5)";

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(has_chromium), ignore = "no Chromium when this was built")]
async fn everybody_can_read_it() {
    let coordinator = Coordinator::start(spec(9)).await;
    let name = "a-machine-with-a-name-as-long-as-names-of-machines-get.farm.example.org";
    let worker = RawWorker::named(&coordinator, name).await;
    let _attendance = worker.attend().await;
    let leased = worker.lease().await;
    worker.submit(leased, b"no picture".to_vec()).await.unwrap_err();
    let mut page = Browser::open(&coordinator.url());
    for passes in [2, 4] {
        deliver(&worker, 2).await;
        page.wait_for(&format!("document.getElementById('shown')?.dataset.passes >= {passes}"));
    }
    page.wait_for("document.querySelector('#curve svg') !== null");
    for width in [320, 390, 768, 1024, 1920] {
        for scheme in ["light", "dark"] {
            page.look(width, scheme);
            let wide = page.evaluate("document.documentElement.scrollWidth");
            assert_eq!(wide, json!(width), "{scheme}");
            assert_eq!(page.evaluate(PALE), json!([]), "{width} {scheme}");
            assert_eq!(page.evaluate(TINY), json!([]), "{width} {scheme}");
            if width < 600 {
                assert_eq!(page.evaluate(SMALL), json!([]), "{width} {scheme}");
            }
        }
    }
    assert_eq!(page.wrongs(), json!([]));
}

/// Screenshots of the page of the job running at BEAMFARM_URL, for docs/manual.md and for inspection: light, dark, as
/// on a phone, and without scripts, into the folder BEAMFARM_SCREENSHOTS. Run it with `--ignored`.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "for the picture in docs/manual.md"]
async fn the_page_in_pictures() {
    let folder = std::env::var_os("BEAMFARM_SCREENSHOTS").expect("BEAMFARM_SCREENSHOTS=FOLDER");
    let url = std::env::var("BEAMFARM_URL").expect("BEAMFARM_URL=http://HOST:PORT");
    let mut page = Browser::open(&url);
    page.wait_for("document.getElementById('shown')?.dataset.passes > 0");
    for (name, width, scheme) in [
        ("light", 1200, "light"),
        ("dark", 1200, "dark"),
        ("tablet", 768, "light"),
        ("phone", 390, "light"),
        ("phone-dark", 390, "dark"),
    ] {
        let path = Path::new(&folder).join(format!("{name}.png"));
        page.screenshot(&path, width, scheme);
    }
    page.evaluate(&format!("({SET})('view', 'error')"));
    page.wait_for("document.getElementById('caption').innerText.startsWith('Error of')");
    page.screenshot(&Path::new(&folder).join("error.png"), 1200, "light");
    page.call("Emulation.setScriptExecutionDisabled", json!({"value": true}));
    page.call("Page.navigate", json!({"url": url}));
    std::thread::sleep(Duration::from_secs(2));
    page.screenshot(&Path::new(&folder).join("no-script.png"), 1200, "light");
}
