//! The bench: what the whole-behaviour tests share.
