//! Browsers that lack something.

use gs_models::Shutter;
use gs_train::run::presentation::Presentation;
use gsburn::report::viewer;

use crate::viewer::browser::{agrees, dom, pictures, with_script};
use crate::viewer::motion::{exposed, taylor};
use crate::viewer::{PHOTO, bytes_of, viewed};

/// A browser that cannot draw to half floats.
const NO_HALF_FLOATS: &str = "WebGL2RenderingContext.prototype.getExtension = () => null;";

/// A browser without WebGL 2.
const NO_WEBGL: &str = "HTMLCanvasElement.prototype.getContext = () => null;";

/// Ten bits are as near to the rasterizer as is asked of half floats, sharp and over an exposure.
#[test]
fn without_half_floats_ten_bits_agree() {
    let scene = taylor();
    let shutter = Shutter { exposure: 0.2, linear: true };
    let packed = viewer::packed(&scene, &Presentation { shutter: Some(shutter), ..viewed("ten bits") });
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    std::fs::write(&page, with_script(&viewer::page("ten bits", &packed), NO_HALF_FLOATS)).expect("written");
    let Some(drawn) = pictures(&page, "0@0,0@0.4,0@1,0@0.3@exposure") else { return };
    for (picture, t) in drawn.iter().zip([0.0, 0.4, 1.0]) {
        agrees(&format!("ten bits at {t}"), picture, &bytes_of(&scene, t));
    }
    agrees("ten bits, exposure", &drawn[3], &exposed(&scene, 0.3, shutter));
    let dom = dom(&page, "").expect("there was a Chromium");
    assert!(dom.contains("ten bits a channel"));
}

/// Without WebGL 2 a page shows its photos and says why; a report says it and goes on with its own pictures.
#[test]
fn without_webgl_there_are_pictures_and_a_sentence() {
    let scene = taylor();
    let mut viewed = viewed("flat");
    viewed.cameras[0].photo = Some(PHOTO.into());
    let packed = viewer::packed(&scene, &viewed);
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let report = format!("<!doctype html>\n<main>{}</main>", viewer::section(&packed));
    for (html, photos) in [(viewer::page("flat", &packed), 1), (report, 0)] {
        std::fs::write(&page, with_script(&html, NO_WEBGL)).expect("written");
        let Some(dom) = dom(&page, "") else { return };
        let shown =
            dom.split_once("id=\"viewer\"").and_then(|(_, rest)| rest.split_once("</div>")).expect("a viewer").0;
        assert!(shown.contains("has no WebGL 2"), "{shown:.300}");
        assert_eq!(shown.matches("<img").count(), photos, "{shown:.300}");
    }
}
