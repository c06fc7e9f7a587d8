//! The valid name most like one that does not exist: keys of a configuration, recipes.

/// Share of the letters that may be wrong in a name that is meant: one of three.
const WRONG_LETTERS: usize = 3;

/// Shortest begin of a name that stands for it.
const BEGIN: usize = 3;

/// The valid name most like `name`; `None` where none is like it. Names are words behind sections
/// (`section.some_words`, `folder/some-words`). A name that is spelled alike in a section that is, too, comes first;
/// then one of that section with a word in common; then one spelled alike in another section, or the first of a section
/// that is spelled like a name without one; and then one elsewhere with a word in common.
pub fn nearest<'a>(name: &str, valid: &'a [String]) -> Option<&'a str> {
    let ranked = valid.iter().filter_map(|candidate| Some((rank(name, candidate)?, candidate)));
    // Of equals the first.
    ranked.min_by_key(|(rank, _)| *rank).map(|(_, candidate)| candidate.as_str())
}

/// The valid names of the section of `name`.
pub fn beside<'a>(name: &str, valid: &'a [String]) -> Vec<&'a str> {
    let section = parts(name).0;
    let names = valid.iter().map(|valid| parts(valid)).filter(|(other, _)| *other == section);
    if section.is_empty() { Vec::new() } else { names.map(|(_, name)| name).collect() }
}

fn rank(name: &str, candidate: &str) -> Option<(usize, usize)> {
    let ((section, last), (other, valid)) = (parts(name), parts(candidate));
    let (sections, names) = (unlike(section, other), unlike(last, valid));
    let has_word = words(last).any(|word| words(valid).any(|other| other == word));
    match (sections, names) {
        (Some(a), Some(b)) => Some((0, a + b)),
        (Some(_), None) if has_word && !section.is_empty() => Some((1, 0)),
        // A folder that is named alone stands for the first in it, and a folder in a folder comes after it.
        _ if section.is_empty() && names != Some(0) && unlike(last, other).is_some() => {
            Some((2, 1 + other.matches('/').count()))
        }
        (_, Some(b)) => Some((2, b)),
        _ if has_word && !other.is_empty() => Some((3, 0)),
        _ => None,
    }
}

/// The section of a name, empty without one, and its last part.
fn parts(name: &str) -> (&str, &str) {
    name.rsplit_once(['.', '/']).unwrap_or(("", name))
}

fn words(name: &str) -> impl Iterator<Item = &str> {
    name.split(['_', '-']).filter(|word| !word.is_empty())
}

/// The letters that are wrong in a spelling of `valid`; `None` where it is another word.
fn unlike(typed: &str, valid: &str) -> Option<usize> {
    let wrong = strsim::damerau_levenshtein(typed, valid);
    let letters = typed.chars().count().max(valid.chars().count());
    let is_begin = typed.len() >= BEGIN && valid.starts_with(typed);
    (wrong * WRONG_LETTERS <= letters || is_begin).then_some(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_string()).collect()
    }

    #[test]
    fn keys_of_the_section_or_with_the_word_come_first() {
        let valid = all(&[
            "steps",
            "eval.at",
            "eval.images",
            "blur.peano",
            "camera.lr",
            "optimiser.eps",
            "optimiser.means_lr",
            "optimiser.sh_lr",
            "optimiser",
            "density.cap",
            "density.start",
            "density",
            "loss.dssim",
            "loss",
        ]);
        let find = |key: &str| nearest(key, &valid);
        assert_eq!(find("optimizer.lr"), Some("optimiser.means_lr"));
        assert_eq!(find("lr"), Some("camera.lr"));
        assert_eq!(find("optimiser.means"), Some("optimiser.means_lr"));
        assert_eq!(find("optimizer.sh_lr"), Some("optimiser.sh_lr"));
        assert_eq!(
            [find("cap"), find("density.capp"), find("stepz")],
            [Some("density.cap"), Some("density.cap"), Some("steps")]
        );
        assert_eq!([find("foo"), find("density.foo"), find("nothing.like.it")], [None; 3]);
        assert_eq!(beside("density.foo", &valid), ["cap", "start"]);
        assert!(beside("foo", &valid).is_empty());
    }

    #[test]
    fn recipes_are_found_by_folder_or_name() {
        let valid = all(&[
            "fluxnet/ablations/no-velocity",
            "fluxnet/base",
            "static/base",
            "static/fox",
            "taylorwaves/ablations/no-taylor",
            "taylorwaves/base",
            "taylorwaves/paper",
        ]);
        let find = |name: &str| nearest(name, &valid);
        assert_eq!(
            [find("static/fix"), find("fox"), find("taylorwaves/papr")],
            [Some("static/fox"), Some("static/fox"), Some("taylorwaves/paper")]
        );
        assert_eq!(
            [find("static"), find("taylor"), find("flux")],
            [Some("static/base"), Some("taylorwaves/base"), Some("fluxnet/base")]
        );
        assert_eq!([find("nope"), find("x")], [None; 2]);
    }
}
