//! The reader and the writer of pickled tables, and hostile bytes.

use proptest::prelude::*;

use super::machine::{OPCODES_MAX, parse};
use super::table::Table;
use super::value::PickleError;
use super::write::{Column, table};

fn sample() -> Vec<u8> {
    let (x, d) = (vec![1.5, -2.25, 1e300], vec![0_i64, 1, -7]);
    let (flag, text) = (vec![true, false, true], vec![Some("Car".to_string()), None, Some("-".to_string())]);
    table(&[
        ("x", Column::F64(&x)),
        ("label", Column::Text(&text)),
        ("d", Column::I64(&d)),
        ("y", Column::F64(&[4.0, 5.0, 6.0])),
        ("stationary", Column::Bool(&flag)),
    ])
}

/// Columns `x`, `y`, `d`, and the number of texts.
type Columns = (Vec<f64>, Vec<f64>, Vec<f64>, usize);

/// All columns as the reader finds them.
fn read(bytes: &[u8]) -> Result<Columns, PickleError> {
    let tree = parse(bytes)?;
    let table = Table::of(&tree)?;
    let texts = table.texts("label")?;
    Ok((table.numbers("x")?, table.numbers("y")?, table.numbers("d")?, texts.iter().flatten().count()))
}

#[test]
fn a_table_comes_back() {
    let bytes = sample();
    let tree = parse(&bytes).expect("a pickle");
    let table = Table::of(&tree).expect("a table");
    assert_eq!(table.rows, 3);
    assert_eq!(table.numbers("x").expect("a column"), [1.5, -2.25, 1e300]);
    assert_eq!(table.numbers("y").expect("a column"), [4.0, 5.0, 6.0]);
    assert_eq!(table.numbers("d").expect("a column"), [0.0, 1.0, -7.0]);
    assert_eq!(table.numbers("stationary").expect("a column"), [1.0, 0.0, 1.0]);
    assert_eq!(table.texts("label").expect("a column"), [Some("Car"), None, Some("-")]);
    let error = table.numbers("z").expect_err("no such column");
    assert!(error.expected.contains("\"z\"") && error.found.contains("stationary"), "{error:?}");
    assert!(table.numbers("label").is_err(), "texts are no numbers");
}

#[test]
fn an_empty_table_is_a_table() {
    let bytes = table(&[("x", Column::F64(&[])), ("label", Column::Text(&[]))]);
    let tree = parse(&bytes).expect("a pickle");
    assert_eq!(Table::of(&tree).expect("a table").numbers("x").expect("a column"), [0.0; 0]);
}

#[test]
fn every_cut_is_an_error() {
    let bytes = sample();
    for cut in 0..bytes.len() {
        assert!(read(&bytes[..cut]).is_err(), "cut to {cut} of {} bytes", bytes.len());
    }
    assert!(read(&bytes).is_ok());
}

#[test]
fn names_from_outside_the_list_are_refused() {
    // What a program that runs pickles would execute: os.system("echo").
    let hostile = b"\x80\x03cos\nsystem\nX\x04\0\0\0echo\x85R.";
    let error = parse(hostile).expect_err("refused");
    assert_eq!(error.found, "`os.system`");
    for name in [
        "builtins\neval",
        "builtins\ngetattr",
        "numpy\nload",
        "pandas\nread_pickle",
        "posix\nsystem",
        "_codecs\nencode",
    ] {
        assert!(parse(format!("c{name}\n.").as_bytes()).is_err(), "{name}");
    }
    // The same in the form of newer protocols, and opcodes that call without a name in the file.
    assert!(parse(b"\x80\x04\x8c\x02os\x8c\x06system\x93.").is_err());
    for opcode in [b'i', b'o', b'P', b'Q', b'S', b'V', b'F', b'I', 0x82, 0x83, 0x84, 0x92, 0x97, 0x98] {
        assert!(parse(&[b'N', opcode, b'1', b'\n', b'.']).is_err(), "opcode {opcode:#x}");
    }
}

#[test]
fn a_small_file_cannot_ask_for_much_memory() {
    // A shape of 2^31 rows over no data, a buffer of 2^32 bytes, a memo of place 2^32 - 1, and opcodes without end.
    let whole = sample();
    let rows = b"J\x03\0\0\0";
    let mut lie = whole.clone();
    for place in (0..whole.len() - 5).filter(|place| whole[*place..].starts_with(rows)) {
        lie[place + 1..place + 5].copy_from_slice(&i32::MAX.to_le_bytes());
    }
    assert_ne!(lie, whole);
    assert!(read(&lie).is_err());
    assert!(parse(b"B\xff\xff\xff\xff").is_err());
    assert!(parse(b"Nr\xff\xff\xff\xffj\xff\xff\xff\xff.").is_ok(), "a memo is no array");
    assert!(parse(&vec![b'N'; OPCODES_MAX + 1]).is_err());
    // An object that is its own state: nothing walks it.
    let circle = b"cpandas.core.frame\nDataFrame\n)\x81q\0h\0b.";
    assert!(parse(circle).and_then(|tree| Table::of(&tree).map(drop)).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_tables_give_numbers_or_an_error(places in prop::collection::vec((any::<u16>(), any::<u8>()), 1..8)) {
        let mut bytes = sample();
        for (place, value) in places {
            let place = usize::from(place) % bytes.len();
            bytes[place] = value;
        }
        if let Ok((x, ..)) = read(&bytes) {
            prop_assert!(x.len() <= bytes.len());
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        if let Ok((x, ..)) = read(&bytes) {
            prop_assert!(x.len() <= bytes.len());
        }
    }
}
