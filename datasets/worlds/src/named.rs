//! Enums whose variants have a name on the command line and a sentence in its help.

/// Declares such an enum. The sentence of a variant is its doc comment without the period.
macro_rules! named {
    ($(#[$attribute:meta])* pub enum $kind:ident { $(#[doc = $words:literal] $variant:ident = $name:literal,)+ }) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $kind {
            $(#[doc = $words] $variant,)+
        }

        impl $kind {
            /// All of them.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// The name on a command line, as [`FromStr`](std::str::FromStr) reads it.
            pub fn name(self) -> &'static str {
                [$($name),+][self as usize]
            }

            /// The sentence without its period.
            pub fn in_words(self) -> &'static str {
                [$($words),+][self as usize].trim().trim_end_matches('.')
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $kind {
            type Err = String;

            fn from_str(name: &str) -> Result<Self, String> {
                let [others @ .., last] = [$($name),+];
                let found = Self::ALL.into_iter().find(|one| one.name() == name);
                found.ok_or_else(|| format!("expected {} or {last}, found {name:?}", others.join(", ")))
            }
        }
    };
}

pub(crate) use named;
