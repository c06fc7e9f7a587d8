//! One mistake of a whole log is found in every file: it is said once, with its count.

use std::path::Path;

use gs_base::{FileError, counted};
use gs_datasets::{Common, DatasetError, said_once};

/// The errors in the order found; those of one kind in the files of one folder are one sentence, with what the first
/// file has.
pub(crate) fn sentences(errors: &[DatasetError]) -> Vec<String> {
    said_once(errors, apart, |count| format!("in {}", counted(count, "file")))
}

/// Places in the files and what was found there may differ.
fn apart(error: &DatasetError) -> Option<Common> {
    let of = |path: &Path, kind: String, complaint: String| {
        let (folder, file) = (path.parent()?.display(), path.file_name()?.to_string_lossy().into_owned());
        Some(Common { kind: format!("{folder}: {kind}"), text: format!("{folder}: {complaint}"), name: file })
    };
    match error {
        DatasetError::File(FileError::Malformed { path, location, expected, found }) => {
            let place: String = location.chars().filter(|c| !c.is_ascii_digit()).collect();
            let complaint = format!("{location}: expected {expected}, found {found}");
            of(path, format!("{place}: expected {expected}"), complaint)
        }
        DatasetError::File(FileError::Io { path, action, source }) => {
            of(path, format!("cannot {action}: {:?}", source.kind()), format!("cannot {action}: {source}"))
        }
        DatasetError::Image { path, found } => {
            let complaint = format!("expected readable PNG or JPEG images, found: {found}");
            of(path, "expected an image".to_string(), complaint)
        }
        DatasetError::File(FileError::NotAFile { path, found }) => {
            of(path, format!("found {found}"), format!("expected files, found {found}"))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_fault_in_many_files_is_one_sentence() {
        let short = |i: usize| {
            let path = format!("log/lidar/{i:02}.pkl.gz");
            DatasetError::malformed(Path::new(&path), format!("byte {}", 100 + i), "a column x", format!("{i} bytes"))
        };
        let other = DatasetError::malformed(Path::new("log/camera/a/00.jpg"), "the image", "8 x 8 pixels", "9 x 9");
        let errors: Vec<DatasetError> = (0..300).map(short).chain([other]).collect();
        let said = sentences(&errors);
        let first = "log/lidar: byte 100: expected a column x, found 0 bytes (in 300 files: 00.pkl.gz, 01.pkl.gz, \
            02.pkl.gz, ...)";
        assert_eq!(said, [first, "log/camera/a/00.jpg: the image: expected 8 x 8 pixels, found 9 x 9"]);
        assert_eq!(sentences(&errors[..1]), [errors[0].to_string()]);
    }
}
