//! The viewer's HTML: a section of a report, a page of its own, a page that follows a training.

use gs_kernels::constants::{ALPHA_MAX, ALPHA_MIN, FRUSTUM_MARGIN};
use gs_models::DynamicScene;

use super::scene::{Packed, packed};
use crate::report::html::{self, MAGNIFICATION};
use gs_train::run::presentation::Presentation;

const CONTROLS: &str = include_str!("viewer.html");
const SCRIPT: &str = include_str!("viewer.js");
const STYLE: &str = include_str!("viewer.css");
const SHADERS: [(&str, &str); 4] = [
    ("splat-vertex", include_str!("splat.vert")),
    ("splat-fragment", include_str!("splat.frag")),
    ("screen-vertex", include_str!("screen.vert")),
    ("screen-fragment", include_str!("screen.frag")),
];

/// Nothing is loaded from anywhere but the page itself (and, when it follows a training, the server that it came from).
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'";

/// The viewer of a scene as a section of a report.
pub fn section(scene: &Packed) -> String {
    format!("<section>\n<h2>Scene</h2>\n<style>\n{STYLE}</style>\n{}</section>\n", body("report", Some(scene)))
}

/// The viewer of a scene as a page of its own.
pub fn page(name: &str, scene: &Packed) -> String {
    whole(name, &body("page", Some(scene)))
}

/// The page of a scene.
pub fn page_of(scene: &dyn DynamicScene, presentation: &Presentation) -> String {
    page(&presentation.name, &packed(scene, presentation))
}

/// The viewer without a scene: the function `follow` of `script` fetches it from the server that sends the page, again
/// and again.
pub fn live_page(name: &str, style: &str, script: &str) -> String {
    whole(name, &format!("<style>\n{style}</style>\n<script>\n{script}</script>\n{}", body("live", None)))
}

fn whole(name: &str, body: &str) -> String {
    let policy = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n");
    let heading = html::name(name);
    html::page(name, &policy, &format!("<h1>{heading}</h1>\n<style>\n{STYLE}</style>\n{body}"))
}

fn body(place: &str, scene: Option<&Packed>) -> String {
    let mut html = format!(
        "<div id=\"viewer\" class=\"viewer\" data-place=\"{place}\" data-magnification=\"{MAGNIFICATION}\">\n{CONTROLS}</div>\n"
    );
    if let Some(Packed { json, block }) = scene {
        html += &format!("<script type=\"application/json\" id=\"viewer-scene\">{json}</script>\n");
        html += &format!("<script type=\"text/plain\" id=\"viewer-block\">{block}</script>\n");
    }
    for (name, source) in SHADERS {
        html += &format!("<script type=\"text/plain\" id=\"{name}\">{}</script>\n", with_constants(source));
    }
    html + "<script>\n" + SCRIPT + "</script>\n"
}

/// A shader with the rasterizer's constants in place of their names.
fn with_constants(source: &str) -> String {
    let constants = [("@ALPHA_MIN@", ALPHA_MIN), ("@ALPHA_MAX@", ALPHA_MAX), ("@FRUSTUM_MARGIN@", FRUSTUM_MARGIN)];
    constants.iter().fold(source.to_string(), |text, (name, value)| text.replace(name, &format!("{value:.9}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hostile_name_stays_text() {
        let name = "</script><img src=x onerror=alert(1)>";
        let scene =
            Packed { json: serde_json::to_string(name).expect("JSON").replace('<', "\\u003c"), block: String::new() };
        let page = page(name, &scene);
        assert!(!page.contains("<img src=x") && page.contains("&lt;/script&gt;"));
        assert_eq!(page.matches("<script").count(), page.matches("</script>").count());
    }

    #[test]
    fn shaders_have_the_constants_of_the_rasterizer() {
        for (name, source) in SHADERS {
            assert!(!with_constants(source).contains('@'), "{name}");
        }
        assert!(with_constants("@ALPHA_MAX@").starts_with("0.999"));
    }
}
