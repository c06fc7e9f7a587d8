//! File names in the order people mean: `frame_2` before `frame_10`.

use std::cmp::Ordering;

/// Compares names with runs of digits taken as numbers.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let ((text_a, number_a, rest_a), (text_b, number_b, rest_b)) = (split(a), split(b));
        // Leading zeros do not count; then a longer number is a larger one, whatever its size.
        let (digits_a, digits_b) = (number_a.trim_start_matches('0'), number_b.trim_start_matches('0'));
        let order = text_a
            .cmp(text_b)
            .then_with(|| digits_a.len().cmp(&digits_b.len()))
            .then_with(|| digits_a.cmp(digits_b))
            .then_with(|| number_a.len().cmp(&number_b.len()));
        if order != Ordering::Equal || (rest_a.is_empty() && rest_b.is_empty()) {
            return order;
        }
        (a, b) = (rest_a, rest_b);
    }
}

/// The text before the first digit, the digits, and the rest.
fn split(name: &str) -> (&str, &str, &str) {
    let digit = name.find(|c: char| c.is_ascii_digit()).unwrap_or(name.len());
    let (text, rest) = name.split_at(digit);
    let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let (number, rest) = rest.split_at(end);
    (text, number, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_as_numbers() {
        let mut names = ["cam10/2", "cam2/10", "cam2/9", "cam02/9", "cam2", "a", "cam2/99999999999999999999999"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["a", "cam2", "cam2/9", "cam2/10", "cam2/99999999999999999999999", "cam02/9", "cam10/2"]);
    }
}
