//! [`Pages`]: the pages of a column chunk, with every size checked before it is believed.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};

use super::codec::unpack;
use super::thrift::{Event, structure};

/// Longest content of a page, bytes. A writer that counts values rather than bytes puts all images of 51 frames into
/// one: some 100 MB.
const CONTENT_MAX: usize = 512 << 20;

/// Most values in a page: constant range images of 51 frames with 64 x 2650 pixels and four channels are one page of 35
/// million.
const VALUES_MAX: i64 = 1 << 26;

/// The pages of a chunk.
pub(crate) struct Pages {
    bytes: Bytes,
    at: usize,
    codec: Compression,
    /// Bytes of one value at least, as they lie in a dictionary.
    value_bytes: i64,
    /// Whether a dictionary was given, without which its indices have no meaning.
    has_dictionary: bool,
}

/// The kinds of pages that are read (`PageType` of the format).
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;
const DATA_V2: i64 = 3;

/// The header of a page.
#[derive(Default)]
struct Header {
    /// Length of the header itself, bytes.
    length: usize,
    kind: i64,
    content: usize,
    packed: usize,
    values: i64,
    encoding: i64,
    /// Encodings of definition and repetition levels, of the first version.
    levels: [i64; 2],
    /// Of the second version: nulls, rows, bytes of definition and of repetition levels.
    v2: [i64; 4],
    /// Of the second version: whether the values are packed; 0 if not.
    is_packed: i64,
}

fn broken(text: impl Into<String>) -> ParquetError {
    ParquetError::General(text.into())
}

impl Pages {
    /// The pages in the bytes of a chunk.
    pub fn new(bytes: Bytes, codec: Compression, value_bytes: i64) -> Self {
        Self { bytes, at: 0, codec, value_bytes, has_dictionary: false }
    }

    /// The next header of a kind that is read; pages of other kinds are passed over.
    fn header(&mut self) -> Result<Option<Header>> {
        while self.at < self.bytes.len() {
            let header = self.parse()?;
            if matches!(header.kind, DATA | DICTIONARY | DATA_V2) {
                return Ok(Some(header));
            }
            self.at += header.length + header.packed;
        }
        Ok(None)
    }

    fn parse(&self) -> Result<Header> {
        let rest = &self.bytes[self.at..];
        let mut header = Header { kind: -1, is_packed: 1, ..Header::default() };
        let (mut content, mut packed) = (-1, -1);
        let length = structure(rest, |path, event| {
            let Event::Integer(value) = event else { return };
            match path {
                [1] => header.kind = value,
                [2] => content = value,
                [3] => packed = value,
                [5 | 7 | 8, 1] => header.values = value,
                [5 | 7, 2] | [8, 4] => header.encoding = value,
                [5, 3] => header.levels[0] = value,
                [5, 4] => header.levels[1] = value,
                [8, 2] => header.v2[0] = value,
                [8, 3] => header.v2[1] = value,
                [8, 5] => header.v2[2] = value,
                [8, 6] => header.v2[3] = value,
                [8, 7] => header.is_packed = value,
                _ => {}
            }
        });
        header.length = length.ok_or_else(|| broken("a broken header of a page"))?;
        let size = |value: i64, most: usize| usize::try_from(value).ok().filter(|size| *size <= most);
        let (Some(content), Some(packed)) = (size(content, CONTENT_MAX), size(packed, rest.len() - header.length))
        else {
            return Err(broken(format!("a page of {packed} bytes with a content of {content} bytes")));
        };
        (header.content, header.packed) = (content, packed);
        if !(0..=VALUES_MAX).contains(&header.values) {
            return Err(broken(format!("a page of {} values", header.values)));
        }
        if header.kind == DICTIONARY && header.values.saturating_mul(self.value_bytes) > content as i64 {
            return Err(broken(format!("a dictionary of {} values in {content} bytes", header.values)));
        }
        let [nulls, rows, definitions, repetitions] = header.v2;
        let levels = definitions.saturating_add(repetitions);
        let is_sound = |count: i64| (0..=header.values).contains(&count);
        if header.kind == DATA_V2
            && !(is_sound(nulls)
                && is_sound(rows)
                && definitions >= 0
                && repetitions >= 0
                && levels <= content.min(packed) as i64)
        {
            return Err(broken("a page with levels or rows beyond its end"));
        }
        Ok(header)
    }

    /// The page of a header, unpacked.
    fn page(&mut self, header: &Header) -> Result<Page> {
        let start = self.at + header.length;
        let packed = self.bytes.slice(start..start + header.packed);
        self.at = start + header.packed;
        let [nulls, rows, definitions, repetitions] = header.v2.map(|value| value as u32);
        // The levels of the second version are not packed.
        let plain = if header.kind == DATA_V2 { (definitions + repetitions) as usize } else { 0 };
        let content = if self.codec == Compression::UNCOMPRESSED || header.is_packed == 0 || header.content == plain {
            if packed.len() < header.content {
                return Err(broken("a page that is shorter than its header says"));
            }
            packed.slice(..header.content)
        } else {
            let rest = unpack(self.codec, &packed[plain..], header.content - plain).map_err(broken)?;
            if plain == 0 { rest.into() } else { [&packed[..plain], &rest].concat().into() }
        };
        let (num_values, encoding) = (header.values as u32, encoding(header.encoding)?);
        let is_index = matches!(encoding, Encoding::PLAIN_DICTIONARY | Encoding::RLE_DICTIONARY);
        if header.kind == DICTIONARY {
            self.has_dictionary = true;
        } else if is_index && !self.has_dictionary {
            return Err(broken("indices without a dictionary"));
        }
        Ok(match header.kind {
            DICTIONARY => Page::DictionaryPage { buf: content, num_values, encoding, is_sorted: false },
            DATA => Page::DataPage {
                buf: content,
                num_values,
                encoding,
                def_level_encoding: self::encoding(header.levels[0])?,
                rep_level_encoding: self::encoding(header.levels[1])?,
                statistics: None,
            },
            _ => Page::DataPageV2 {
                buf: content,
                num_values,
                encoding,
                num_nulls: nulls,
                num_rows: rows,
                def_levels_byte_len: definitions,
                rep_levels_byte_len: repetitions,
                is_compressed: false,
                statistics: None,
            },
        })
    }
}

/// The encodings by their numbers in the format.
fn encoding(number: i64) -> Result<Encoding> {
    Ok(match number {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        5 => Encoding::DELTA_BINARY_PACKED,
        6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        7 => Encoding::DELTA_BYTE_ARRAY,
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        _ => return Err(broken(format!("the encoding {number}, which is not read"))),
    })
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        match self.header()? {
            Some(header) => self.page(&header).map(Some),
            None => Ok(None),
        }
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        Ok(self.header()?.map(|header| match header.kind {
            DICTIONARY => PageMetadata { num_rows: None, num_levels: None, is_dict: true },
            DATA_V2 => PageMetadata {
                num_rows: Some(header.v2[1] as usize),
                num_levels: Some(header.values as usize),
                is_dict: false,
            },
            _ => PageMetadata { num_rows: None, num_levels: Some(header.values as usize), is_dict: false },
        }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        if let Some(header) = self.header()? {
            self.at += header.length + header.packed;
        }
        Ok(())
    }
}
