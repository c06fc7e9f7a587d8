//! Text and pictures in HTML, and whole pages.

use anyhow::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gs_base::printable;
use gs_datasets::image_io::encode_png;

use gs_train::run::outputs::MARK;

/// The look of all pages.
const STYLE: &str = include_str!("style.css");

/// Most pixels of a page for one of a picture. A picture of 64 pixels that fills a page looks broken rather than small.
pub const MAGNIFICATION: usize = 4;

/// Width of the text of a page, pixels, as style.css has it. A picture that may be magnified without reaching it shows
/// its pixels.
const PAGE_WIDTH: usize = 1400;

/// Text with HTML's special characters escaped.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A name or path in a sentence: a direction of writing that it turns round ends with it.
pub fn name(text: &str) -> String {
    format!("<bdi>{}</bdi>", escaped(text))
}

/// A name where no element can stand: in an attribute, or the title of a page.
pub fn plain_name(text: &str) -> String {
    escaped(&printable(text))
}

/// A row of a table; `cells` are HTML.
pub fn row(cell: &str, cells: impl IntoIterator<Item = String>) -> String {
    format!("<tr>{}</tr>\n", self::cells(cell, cells))
}

/// The cells of a row, of the element `cell`.
pub fn cells(cell: &str, cells: impl IntoIterator<Item = String>) -> String {
    cells.into_iter().map(|html| format!("<{cell}>{html}</{cell}>")).collect()
}

/// A whole page that needs no other file, named for its tab; `head` is put into its head.
pub fn page(title: &str, head: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<!-- {MARK} -->\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{head}<meta \
         name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{} · gsburn</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        plain_name(title)
    )
}

/// A picture of 8 bits with its caption as a [`figure`].
///
/// # Errors
/// When it cannot be encoded.
pub fn picture(size: [usize; 2], pixels: &[u8], what: &str, caption: &str) -> Result<String> {
    Ok(figure(&encode_png("report".as_ref(), size[0], size[1], pixels)?, size, what, caption))
}

/// A picture as PNG with its caption, HTML. `what` says to those who do not see it what it is.
pub fn figure(png: &[u8], [width, height]: [usize; 2], what: &str, caption: &str) -> String {
    let widest = MAGNIFICATION * width;
    let small = if widest <= PAGE_WIDTH { " class=\"small\"" } else { "" };
    format!(
        "<figure><img{small} alt=\"{}\" width=\"{width}\" height=\"{height}\" style=\"max-width:{widest}px\" \
         src=\"data:image/png;base64,{}\">\n<figcaption>{caption}</figcaption></figure>\n",
        plain_name(what),
        STANDARD.encode(png)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_page() {
        assert_eq!(escaped("a<b>&\"c"), "a&lt;b&gt;&amp;&quot;c");
        assert_eq!(name("a\u{202e}<b"), "<bdi>a\u{202e}&lt;b</bdi>");
        let page = page("a\u{202e}b", "", "");
        assert!(page.contains("<title>a\\u{202e}b · gsburn</title>") && !page.contains('\u{202e}'), "{page:.300}");
    }

    #[test]
    fn a_small_picture_stays_small() {
        let of = |width| figure(&[], [width, 48], "a", "b");
        assert!(of(64).contains("class=\"small\"") && of(64).contains("max-width:256px"));
        assert!(!of(1280).contains("class"));
    }
}
