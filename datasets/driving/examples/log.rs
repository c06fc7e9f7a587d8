//! Makes a synthetic street, or reports on a driving log and draws its LiDAR into its images.
//!
//! ```text
//! cargo run --release -p gs-driving --example log -- make street 7
//! cargo run --release -p gs-driving --example log -- check street pictures
//! ```

use std::path::Path;
use std::process::ExitCode;

use gs_driving::{LogOptions, check};
use gs_worlds::driving::{StreetOptions, write};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["make", folder, seed] => {
            let options = StreetOptions { seed: seed.parse().unwrap_or_default(), ..StreetOptions::default() };
            match write(Path::new(folder), &options, |_, _| {}) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => {
                    eprintln!("{error}");
                    ExitCode::FAILURE
                }
            }
        }
        ["check", log, pictures] => {
            let report = check(Path::new(log), &LogOptions::default(), Some(Path::new(pictures)));
            println!("{report}");
            if report.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        _ => {
            eprintln!("log make FOLDER SEED, or log check LOG PICTURES");
            ExitCode::FAILURE
        }
    }
}
