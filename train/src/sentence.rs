//! One sentence for an error.

/// An error and its causes on one line. A cause that is already part of the text is not repeated.
pub fn one_sentence(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string().replace('\n', " ");
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::one_sentence;

    #[test]
    fn causes_are_said_once() {
        let inner = anyhow::anyhow!("disk full");
        assert_eq!(one_sentence(&inner.context("a.ply: cannot write")), "a.ply: cannot write: disk full");
        let repeated = anyhow::anyhow!("disk full").context("a.ply: cannot write: disk full");
        assert_eq!(one_sentence(&repeated), "a.ply: cannot write: disk full");
    }
}
