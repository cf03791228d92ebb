//! Frames along a rod: time-parallel reference frames and material frames.
//!
//! Each edge carries a reference frame (tangent t, directors d1 and d2 = t x d1), transported in
//! parallel from the last accepted step's tangent to today's, and the material frame (m1, m2), the
//! reference frame turned about t by the edge's angle. The reference twist at a node measures how
//! the directors turn between its two edges beyond parallel transport (Jawed et al. 2018, ch. 4-6).

use crate::V3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Transports `u`, perpendicular to the unit vector `from`, along the shortest turn to the unit vector `to`.
///
/// Undefined (not finite) when `to` is opposite to `from`.
#[inline(always)]
pub fn parallel_transport(u: V3, from: V3, to: V3) -> V3 {
    let axis = from.cross(&to);
    let cosine = from.dot(&to);
    u * cosine + axis.cross(&u) + axis * (axis.dot(&u) / (1.0 + cosine))
}

/// Reference frames at the last accepted step, the memory that time-parallel transport starts from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFrames {
    /// Unit tangents, one an edge.
    pub tangent: Vec<V3>,
    /// First directors, one an edge.
    pub director: Vec<V3>,
    /// Reference twist in rad, one a node (zero at the ends); unwrapped.
    pub twist: Vec<f64>,
}

impl ReferenceFrames {
    /// Directors transported in parallel along the rod from the first edge: no reference twist anywhere.
    pub fn transported_along(nodes: &[V3]) -> Self {
        let tangent: Vec<V3> = nodes.windows(2).map(|p| (p[1] - p[0]).normalize()).collect();
        let first = tangent[0];
        let helper = if first.x.abs() < 0.9 { V3::x() } else { V3::y() };
        let mut director = vec![first.cross(&helper).normalize()];
        for pair in tangent.windows(2) {
            let moved = parallel_transport(director[director.len() - 1], pair[0], pair[1]);
            director.push((moved - pair[1] * moved.dot(&pair[1])).normalize());
        }
        Self { tangent, director, twist: vec![0.0; nodes.len()] }
    }
}

/// Frames and lengths at a trial shape; scratch that [`Frames::update`] overwrites.
#[derive(Clone, Debug)]
pub struct Frames {
    /// Unit tangents, one an edge.
    pub tangent: Vec<V3>,
    /// Edge lengths in m.
    pub length: Vec<f64>,
    /// Reference directors d1, one an edge.
    pub director: Vec<V3>,
    /// First material directors m1, one an edge.
    pub m1: Vec<V3>,
    /// Second material directors m2, one an edge.
    pub m2: Vec<V3>,
    /// Curvature binormals kb = 2 e x f / (|e| |f| + e.f), one a node (zero at the ends).
    pub binormal: Vec<V3>,
    /// 1/(1 + t_{i-1}.t_i), one a node (1/2 at the ends).
    pub inverse_chi: Vec<f64>,
    /// Reference twist in rad, one a node (zero at the ends).
    pub reference_twist: Vec<f64>,
}

impl Frames {
    /// Scratch for a rod of `n` nodes.
    pub fn new(n: usize) -> Self {
        let edges = || vec![V3::zeros(); n - 1];
        Self {
            tangent: edges(),
            length: vec![0.0; n - 1],
            director: edges(),
            m1: edges(),
            m2: edges(),
            binormal: vec![V3::zeros(); n],
            inverse_chi: vec![0.5; n],
            reference_twist: vec![0.0; n],
        }
    }

    /// Computes everything at the shape `nodes` (length n) with the edge angles `angles` (length n - 1).
    pub fn update(&mut self, reference: &ReferenceFrames, nodes: &[V3], angles: &[f64]) {
        let edges = self.tangent.len();
        for e in 0..edges {
            let edge = nodes[e + 1] - nodes[e];
            let length = edge.norm();
            let tangent = edge / length;
            let moved = parallel_transport(reference.director[e], reference.tangent[e], tangent);
            let d1 = (moved - tangent * moved.dot(&tangent)).normalize();
            let d2 = tangent.cross(&d1);
            let (sine, cosine) = angles[e].sin_cos();
            self.length[e] = length;
            self.tangent[e] = tangent;
            self.director[e] = d1;
            self.m1[e] = d1 * cosine + d2 * sine;
            self.m2[e] = d2 * cosine - d1 * sine;
        }
        for i in 1..edges {
            let (before, after) = (self.tangent[i - 1], self.tangent[i]);
            let inverse_chi = 1.0 / (1.0 + before.dot(&after));
            self.inverse_chi[i] = inverse_chi;
            self.binormal[i] = before.cross(&after) * (2.0 * inverse_chi);
            let carried = parallel_transport(self.director[i - 1], before, after);
            let d1 = self.director[i];
            let wrapped = d1.dot(&after.cross(&carried)).atan2(d1.dot(&carried));
            let off = reference.twist[i] - wrapped;
            let turns = if off.abs() <= PI { 0.0 } else { (off / TAU).round() };
            self.reference_twist[i] = wrapped + TAU * turns;
        }
    }

    /// Makes this shape the memory of later steps.
    pub fn accept(&self, reference: &mut ReferenceFrames) {
        reference.tangent.copy_from_slice(&self.tangent);
        reference.director.copy_from_slice(&self.director);
        reference.twist.copy_from_slice(&self.reference_twist);
    }

    /// Curvatures kappa1, kappa2 at an inner node (dimensionless).
    ///
    /// kappa1 = (m2_{i-1} + m2_i).kb/2, kappa2 = -(m1_{i-1} + m1_i).kb/2.
    #[inline(always)]
    pub fn curvature(&self, i: usize) -> [f64; 2] {
        let kb = self.binormal[i];
        [0.5 * kb.dot(&(self.m2[i - 1] + self.m2[i])), -0.5 * kb.dot(&(self.m1[i - 1] + self.m1[i]))]
    }

    /// Twist in rad at an inner node: difference of the edge angles plus reference twist.
    #[inline(always)]
    pub fn twist(&self, i: usize, angles: &[f64]) -> f64 {
        angles[i] - angles[i - 1] + self.reference_twist[i]
    }
}
