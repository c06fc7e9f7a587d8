//! Names that differ in Unicode form alone: macOS and some archives write `é` as `e` with a combining accent (NFD),
//! others as one character (NFC).
//!
//! Without the tables of Unicode, a character and a letter with marks count as alike where they stand at the same place
//! of two names that are equal otherwise; callers take such a name only if no other one is like it.

/// A name with one sign for each cluster that is not ASCII: names that differ in form alone have one outline.
pub(super) fn outline(name: &str) -> String {
    clusters(name).map(|cluster| if cluster.is_ascii() { cluster } else { "\u{fffd}" }).collect()
}

/// Whether two names are equal but for the form of their letters.
pub(super) fn same_but_for_form(a: &str, b: &str) -> bool {
    let is_one = |cluster: &str| cluster.chars().count() == 1;
    let alike = |a: &str, b: &str| a == b || is_one(a) != is_one(b) && !a.is_ascii() && !b.is_ascii();
    a != b && clusters(a).count() == clusters(b).count() && clusters(a).zip(clusters(b)).all(|(a, b)| alike(a, b))
}

/// Each character with the marks behind it.
fn clusters(name: &str) -> impl Iterator<Item = &str> {
    let mut rest = name;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let marks = &rest[first.len_utf8()..];
        let end = first.len_utf8() + marks.find(|c| !is_mark(c)).unwrap_or(marks.len());
        let (cluster, behind) = rest.split_at(end);
        rest = behind;
        Some(cluster)
    })
}

/// Combining accents, voicing marks of kana, and the vowels and final consonants that a decomposed Hangul syllable
/// consists of.
fn is_mark(c: char) -> bool {
    matches!(c, '\u{300}'..='\u{36f}' | '\u{3099}' | '\u{309a}' | '\u{1160}'..='\u{11ff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_of_one_name_are_alike_and_other_names_are_not() {
        for (composed, decomposed) in [
            ("m\u{e9}nage", "me\u{301}nage"),
            ("\u{304c}1", "\u{304b}\u{3099}1"),
            ("\u{ac01}", "\u{1100}\u{1161}\u{11a8}"),
        ] {
            assert!(same_but_for_form(composed, decomposed) && same_but_for_form(decomposed, composed), "{composed}");
            assert_eq!(outline(composed), outline(decomposed));
        }
        for (a, b) in
            [("m\u{e9}nage", "menage"), ("\u{5199}1", "\u{753b}1"), ("\u{e9}1", "e\u{301}2"), ("\u{e9}", "\u{e9}")]
        {
            assert!(!same_but_for_form(a, b), "{a} {b}");
        }
    }
}
