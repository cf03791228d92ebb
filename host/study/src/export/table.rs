//! A table: columns with names, units and values.

use std::borrow::Cow;

/// A column.
#[derive(Clone, PartialEq, Debug)]
pub struct Column {
    /// Name, with the unit.
    pub name: Cow<'static, str>,
    /// The unit alone, for the column's metadata; empty if the table has none.
    pub unit: Cow<'static, str>,
    /// Description, for the header.
    pub about: Cow<'static, str>,
    /// One value per row.
    pub values: Values,
}

impl Column {
    fn new(name: impl Into<Text>, unit: &'static str, about: impl Into<Text>, values: Values) -> Self {
        Self { name: name.into(), unit: unit.into(), about: about.into(), values }
    }
}

type Text = Cow<'static, str>;

/// The rows of a table, from which its columns take their values.
pub(crate) struct Rows<'a, T>(pub &'a [T]);

impl<T> Rows<'_, T> {
    fn all<V>(&self, of: impl Fn(&T) -> V) -> Vec<V> {
        self.0.iter().map(of).collect()
    }

    /// Returns a column of measured numbers; its name has the unit.
    pub fn real<V: Into<Option<f64>>>(
        &self,
        name: impl Into<Text>,
        about: impl Into<Text>,
        of: impl Fn(&T) -> V,
    ) -> Column {
        Column::new(name, "", about, Values::Real(self.all(|row| of(row).into().unwrap_or(f64::NAN))))
    }

    /// Returns a column of numbers with all their digits.
    pub fn exact<A: Into<Text>>(
        &self,
        name: impl Into<Text>,
        unit: &'static str,
        about: A,
        of: impl Fn(&T) -> f64,
    ) -> Column {
        Column::new(name, unit, about, Values::Exact(self.all(of)))
    }

    /// Returns a column of integers.
    pub fn int(&self, name: &'static str, unit: &'static str, about: &'static str, of: impl Fn(&T) -> i64) -> Column {
        Column::new(name, unit, about, Values::Int(self.all(of)))
    }

    /// Returns a column of texts.
    pub fn text(&self, name: &'static str, about: &'static str, of: impl Fn(&T) -> String) -> Column {
        Column::new(name, "", about, Values::Text(self.all(of)))
    }
}

/// The values of a column.
#[derive(Clone, PartialEq, Debug)]
pub enum Values {
    /// Measured real numbers, which CSV rounds to nine decimals; NaN is a missing value.
    Real(Vec<f64>),
    /// Real numbers with all their digits; NaN is a missing value.
    Exact(Vec<f64>),
    /// Integers.
    Int(Vec<i64>),
    /// Texts.
    Text(Vec<String>),
}

impl Values {
    /// Returns the values as real numbers. Text that is not a number gives NaN.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Real(values) | Self::Exact(values) => values.clone(),
            Self::Int(values) => values.iter().map(|value| *value as f64).collect(),
            Self::Text(values) => values.iter().map(|text| text.parse().unwrap_or(f64::NAN)).collect(),
        }
    }

    /// Returns the number of rows.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) | Self::Exact(values) => values.len(),
            Self::Int(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }
}

/// A table with its header.
#[derive(Clone, PartialEq, Debug)]
pub struct Table {
    /// Header lines about the whole table.
    pub header: Vec<String>,
    /// The columns, of equal length.
    pub columns: Vec<Column>,
}

impl Table {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }
}
