//! Writes a table as PandaSet's files hold one: pickle protocol 3, a DataFrame with one block a type.

/// The values of one column.
#[derive(Debug, Clone)]
pub enum Column<'a> {
    /// Numbers.
    F64(&'a [f64]),
    /// Whole numbers.
    I64(&'a [i64]),
    /// Truth values.
    Bool(&'a [bool]),
    /// A missing text is NaN, as pandas writes it.
    Text(&'a [Option<String>]),
}

impl Column<'_> {
    fn rows(&self) -> usize {
        match self {
            Self::F64(values) => values.len(),
            Self::I64(values) => values.len(),
            Self::Bool(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// The order of blocks: 0 to 3 by type.
    fn block(&self) -> usize {
        match self {
            Self::F64(_) => 0,
            Self::I64(_) => 1,
            Self::Bool(_) => 2,
            Self::Text(_) => 3,
        }
    }
}

/// Type names of the blocks, and the last flag of their types: 63 for objects.
const TYPES: [(&str, &str, u8); 4] = [("f8", "<", 0), ("i8", "<", 0), ("b1", "|", 0), ("O8", "|", 63)];

/// The pickle of a table. Columns have equally many values.
pub fn table(columns: &[(&str, Column<'_>)]) -> Vec<u8> {
    let rows = columns.first().map_or(0, |column| column.1.rows());
    debug_assert!(columns.iter().all(|column| column.1.rows() == rows), "columns have equally many values");
    let mut out = Writer { bytes: vec![0x80, 3] };
    out.global("pandas.core.frame", "DataFrame");
    out.bytes.extend(b")\x81}(");
    out.text("_data");
    out.global("pandas.core.internals.managers", "BlockManager");
    // The state is a tuple of four: only the last part is read by pandas 0.14 and later, so the three before it are
    // empty.
    out.bytes.extend(b")\x81(]]]}");
    out.text("0.14.1");
    out.bytes.extend(b"}(");
    out.text("axes");
    out.bytes.extend(b"](");
    out.names(columns);
    out.range(rows);
    out.bytes.push(b'e');
    out.text("blocks");
    out.bytes.extend(b"](");
    for kind in 0..TYPES.len() {
        out.block(columns, kind, rows);
    }
    out.bytes.extend(b"eustb");
    out.text("_typ");
    out.text("dataframe");
    out.text("_metadata");
    out.bytes.push(b']');
    out.text("attrs");
    out.bytes.extend(b"}ub.");
    out.bytes
}

struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn global(&mut self, module: &str, name: &str) {
        self.bytes.extend(format!("c{module}\n{name}\n").as_bytes());
    }

    fn text(&mut self, text: &str) {
        self.bytes.push(b'X');
        self.bytes.extend((text.len() as u32).to_le_bytes());
        self.bytes.extend(text.as_bytes());
    }

    /// Counts and positions, which are below 2^31.
    fn int(&mut self, value: usize) {
        self.bytes.push(b'J');
        self.bytes.extend((value as i32).to_le_bytes());
    }

    /// An array: its shape, and its data by `data`.
    fn array(&mut self, shape: &[usize], kind: usize, data: impl FnOnce(&mut Self)) {
        let (name, order, flag) = TYPES[kind];
        self.global("numpy.core.multiarray", "_reconstruct");
        self.global("numpy", "ndarray");
        self.bytes.extend(b"K\x00\x85C\x01b\x87R(K\x01");
        self.bytes.push(b'(');
        shape.iter().for_each(|n| self.int(*n));
        self.bytes.push(b't');
        self.global("numpy", "dtype");
        self.text(name);
        self.bytes.extend(b"K\x00K\x01\x87R(K\x03");
        self.text(order);
        self.bytes.extend(b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK");
        self.bytes.extend([flag, b't', b'b', 0x89]);
        data(self);
        self.bytes.extend(b"tb");
    }

    fn buffer(&mut self, parts: impl Iterator<Item = Vec<u8>>) {
        self.bytes.extend(b"B\0\0\0\0");
        let start = self.bytes.len();
        parts.for_each(|part| self.bytes.extend(part));
        let count = (self.bytes.len() - start) as u32;
        self.bytes[start - 4..start].copy_from_slice(&count.to_le_bytes());
    }

    fn index(&mut self, class: &str, module: &str) {
        self.global("pandas.core.indexes.base", "_new_Index");
        self.global(module, class);
        self.bytes.extend(b"}(");
    }

    fn names(&mut self, columns: &[(&str, Column<'_>)]) {
        self.index("Index", "pandas.core.indexes.base");
        self.text("data");
        self.array(&[columns.len()], 3, |out| {
            out.bytes.extend(b"](");
            columns.iter().for_each(|column| out.text(column.0));
            out.bytes.push(b'e');
        });
        self.text("name");
        self.bytes.extend(b"Nu\x86R");
    }

    fn range(&mut self, rows: usize) {
        self.index("RangeIndex", "pandas.core.indexes.range");
        self.text("name");
        self.bytes.push(b'N');
        for (name, value) in [("start", 0), ("stop", rows), ("step", 1)] {
            self.text(name);
            self.int(value);
        }
        self.bytes.extend(b"u\x86R");
    }

    /// The block of one type, if there are columns of it.
    fn block(&mut self, columns: &[(&str, Column<'_>)], kind: usize, rows: usize) {
        let chosen: Vec<usize> = (0..columns.len()).filter(|index| columns[*index].1.block() == kind).collect();
        if chosen.is_empty() {
            return;
        }
        let values = |index: &usize| &columns[*index].1;
        self.bytes.extend(b"}(");
        self.text("values");
        self.array(&[chosen.len(), rows], kind, |out| {
            if kind == 3 {
                out.bytes.extend(b"](");
                chosen.iter().for_each(|index| out.texts(values(index)));
                out.bytes.push(b'e');
            } else {
                out.buffer(chosen.iter().map(|index| raw(values(index))));
            }
        });
        self.text("mgr_locs");
        let places = chosen.iter().map(|index| (*index as i64).to_le_bytes().to_vec());
        self.array(&[chosen.len()], 1, |out| out.buffer(places));
        self.bytes.push(b'u');
    }

    fn texts(&mut self, column: &Column<'_>) {
        let Column::Text(values) = column else { return };
        for value in *values {
            match value {
                Some(text) => self.text(text),
                None => {
                    self.bytes.push(b'G');
                    self.bytes.extend(f64::NAN.to_be_bytes());
                }
            }
        }
    }
}

fn raw(column: &Column<'_>) -> Vec<u8> {
    match column {
        Column::F64(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Column::I64(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Column::Bool(values) => values.iter().map(|value| u8::from(*value)).collect(),
        Column::Text(_) => Vec::new(),
    }
}
