//! Pickled pandas tables, without Python: a machine for a closed list of opcodes and names, a reader of tables, and a
//! writer.
//!
//! Nothing in a file can run code. A name from outside the list is an error, and a call is stored as the pair of its
//! name and its arguments: [`table`] looks at these pairs and never evaluates one. A string or a buffer is a slice of
//! the file, so the memory is bounded by the file's length and by [`machine::OPCODES_MAX`].
//!
//! Read are protocols 3 to 5 as pandas 0.25 to 3 write them. Written is protocol 3 in the layout of PandaSet.

pub(crate) mod array;
pub(crate) mod machine;
pub(crate) mod table;
pub(crate) mod value;
pub(crate) mod write;

#[cfg(test)]
mod tests;
