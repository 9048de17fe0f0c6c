//! Where a ray meets a field: alone, or among the props of an app.

mod field;
mod normal;
mod props;

pub use field::FieldHit;
pub use props::{PropHit, PropRayCast};
