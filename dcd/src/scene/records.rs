//! Converts a scene to records, its wire form.

use super::Scene;
use crate::physics::{ShapeError, ShapeLibrary, joint_record};
use crate::protocol::{BodyRecord, JointRecord};
use crate::space::{BodyId, JointId};

impl Scene {
    /// Returns the scene's bodies and joints by id; their shapes are added to `shapes`.
    #[doc(hidden)]
    pub fn records(
        &self,
        shapes: &mut ShapeLibrary,
    ) -> Result<(Vec<BodyRecord>, Vec<JointRecord>), ShapeError> {
        let id = |index: usize| BodyId::persistent(index as u32);
        let bodies = self
            .bodies
            .iter()
            .enumerate()
            .map(|(index, body)| shapes.describe(id(index), body.pose, &body.body.build(), &body.colliders))
            .collect::<Result<_, _>>()?;
        let joints = self
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| {
                let (a, b) = (id(joint.a), id(joint.b));
                let link = self.link_record(joint);
                JointRecord { link, ..joint_record(JointId(index as u64), a, b, &joint.joint) }
            })
            .collect();
        Ok((bodies, joints))
    }
}
