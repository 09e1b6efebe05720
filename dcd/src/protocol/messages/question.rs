//! What a client asks about the bodies of the world, and what their owners answer.

use bincode::{Decode, Encode};

use crate::space::{BodyId, ClientId};

/// Most rays of one question, and most bodies that it leaves out.
pub const MAX_RAYS: usize = 1_024;
/// Most rays of all questions of one client that are not answered.
pub const MAX_OPEN_RAYS: usize = 4 * MAX_RAYS;
/// Most questions of one client that are not answered.
pub const MAX_OPEN_QUESTIONS: usize = 64;

/// Rays through the world, and what all of them overlook.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Question {
    /// The client's own, unlike those of its other questions.
    pub number: u64,
    /// Kinds that are left out, as bits of Rapier's `QueryFilterFlags`.
    pub flags: u32,
    /// Groups that the rays belong to: who meets none of them is left out. 0 asks nobody.
    pub groups: u32,
    /// Bodies that are left out, in id order; at most [`MAX_RAYS`].
    pub exclude: Vec<BodyId>,
    /// At most [`MAX_RAYS`].
    pub rays: Vec<RayQuestion>,
}

/// One ray.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayQuestion {
    /// Where it starts, in world space, metres.
    pub origin: [f64; 3],
    /// Where it goes; of any length above 0.
    pub direction: [f32; 3],
    /// How far, metres; may be infinite.
    pub max_m: f64,
    /// Whether a body that it starts in is met there at once.
    pub solid: bool,
    /// Groups that it meets.
    pub mask: u32,
    /// A body that is left out.
    pub exclude: Option<BodyId>,
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayAnswer {
    /// Which body.
    pub body: BodyId,
    /// Which of its colliders.
    pub collider: u32,
    /// Where, in world space, metres.
    pub point: [f64; 3],
    /// Outward unit normal there; zero where the ray starts inside.
    pub normal: [f32; 3],
    /// From the origin, metres.
    pub distance_m: f64,
    /// Part of a compound, triangle of a mesh.
    pub subshape: u32,
}

impl RayAnswer {
    /// The nearer of two; of equally near ones, that of the lower id.
    pub fn nearer(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        let key = |hit: &Self| (hit.body, hit.collider);
        match (a, b) {
            (Some(a), Some(b)) => {
                let order = a.distance_m.total_cmp(&b.distance_m).then(key(&a).cmp(&key(&b)));
                Some(if order.is_le() { a } else { b })
            }
            (a, b) => a.or(b),
        }
    }
}

/// What one member's own bodies answer, after the tick that the question came with.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Answer {
    /// Whose question.
    pub client: ClientId,
    /// Which.
    pub number: u64,
    /// By ray; none where it meets none of them.
    pub hits: Vec<Option<RayAnswer>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Check, FromClient};

    #[test]
    fn questions_are_of_finite_rays_that_go_somewhere() {
        let ray = RayQuestion {
            origin: [1.0, 2.0, 3.0],
            direction: [0.0, -1.0, 0.0],
            max_m: f64::INFINITY,
            solid: true,
            mask: u32::MAX,
            exclude: None,
        };
        let check = |ray: RayQuestion, count: usize| {
            let exclude = (0..count as u32).map(BodyId::persistent).collect();
            FromClient::Ask(Question { number: 1, flags: 0, groups: 0, exclude, rays: vec![ray; count] })
                .check()
        };
        assert_eq!(check(ray, MAX_RAYS), Ok(()));
        assert!(check(ray, MAX_RAYS + 1).is_err());
        for wrong in [
            RayQuestion { origin: [f64::NAN; 3], ..ray },
            RayQuestion { direction: [0.0; 3], ..ray },
            RayQuestion { direction: [f32::INFINITY; 3], ..ray },
            RayQuestion { max_m: f64::NAN, ..ray },
            RayQuestion { max_m: -1.0, ..ray },
        ] {
            assert!(check(wrong, 1).is_err(), "{wrong:?}");
        }
    }
}
