//! Frames along a rod: time-parallel reference frames and material frames.
//!
//! Each edge carries a reference frame (tangent t, directors d1 and d2 = t x d1), transported in
//! parallel from the last accepted step's tangent to the present one, and the material frame (m1, m2), the reference
//! frame turned about t by the edge's angle. The reference twist at a node measures how the directors rotate between
//! its two edges beyond parallel transport (Jawed et al. 2018, ch. 4-6).

use crate::V3;
use crate::lanes::{Vectors, Wide, Wide3, padded};
use crate::simd::{Kernel, Simd, dispatch};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Transports `u`, perpendicular to the unit vector `from`, along the shortest rotation to the unit vector `to`.
///
/// Undefined (not finite) when `to` is opposite to `from`.
#[inline(always)]
pub fn parallel_transport(u: V3, from: V3, to: V3) -> V3 {
    let axis = from.cross(&to);
    let cosine = from.dot(&to);
    u * cosine + axis.cross(&u) + axis * (axis.dot(&u) / (1.0 + cosine))
}

/// Reference frames at the last accepted step, from which time-parallel transport starts.
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
    /// Returns frames transported in parallel along the rod from the first edge, without reference twist.
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
    pub tangent: Vectors,
    /// Edge lengths in m, padded.
    pub length: Vec<f64>,
    /// Reference directors d1, one an edge.
    pub director: Vectors,
    /// First material directors m1, one an edge.
    pub m1: Vectors,
    /// Second material directors m2, one an edge.
    pub m2: Vectors,
    /// Curvature binormals kb = 2 e x f / (|e| |f| + e.f), one a node (zero at the ends).
    pub binormal: Vectors,
    /// 1/(1 + t_{i-1}.t_i), one a node, padded.
    pub inverse_chi: Vec<f64>,
    /// Reference twist in rad, one a node (zero at the ends), padded.
    pub reference_twist: Vec<f64>,
    edges: usize,
    shape: Vectors,
    angles: Vec<f64>,
    before: [Vectors; 2],
    twist_before: Vec<f64>,
    /// Scratch of the gradient.
    pub(super) gradients: Vec<f64>,
}

impl Frames {
    /// Returns scratch for a rod of `n` nodes.
    pub fn new(n: usize) -> Self {
        let vectors = || Vectors::new(n);
        let values = || vec![0.0; padded(n)];
        Self {
            tangent: vectors(),
            length: values(),
            director: vectors(),
            m1: vectors(),
            m2: vectors(),
            binormal: vectors(),
            inverse_chi: values(),
            reference_twist: values(),
            edges: n - 1,
            shape: vectors(),
            angles: values(),
            before: [vectors(), vectors()],
            twist_before: values(),
            gradients: Vec::new(),
        }
    }

    /// Computes everything at the shape `nodes` (length n) with the edge angles `angles` (length n - 1).
    pub fn update(&mut self, reference: &ReferenceFrames, nodes: &[V3], angles: &[f64]) {
        self.start_from(reference);
        self.update_at(nodes, angles);
    }

    /// Sets the reference frames of the shapes to come.
    pub fn start_from(&mut self, reference: &ReferenceFrames) {
        self.before[0].copy_from(&reference.tangent);
        self.before[1].copy_from(&reference.director);
        self.twist_before[..reference.twist.len()].copy_from_slice(&reference.twist);
    }

    /// Computes everything at another shape, with the reference frames of before.
    pub fn update_at(&mut self, nodes: &[V3], angles: &[f64]) {
        self.shape.copy_from(nodes);
        self.angles[..angles.len()].copy_from_slice(angles);
        dispatch(Update(self));
        self.binormal.set(self.edges, V3::zeros());
        self.reference_twist[self.edges] = 0.0;
    }

    #[inline(always)]
    fn update_edges<S: Simd>(&mut self, simd: S) {
        for e in (0..self.edges).step_by(S::F64_LANES) {
            let edge = self.shape.load(simd, e + 1) - self.shape.load(simd, e);
            let length = edge.dot(edge).sqrt();
            let tangent = edge * length.inverse();
            let [before, director] = [&self.before[0], &self.before[1]].map(|vectors| vectors.load(simd, e));
            let moved = transport(director, before, tangent, before.dot(tangent).plus_one().inverse());
            let across = moved - tangent * moved.dot(tangent);
            let d1 = across * across.dot(across).sqrt().inverse();
            let d2 = tangent.cross(d1);
            let (sine, cosine) = Wide::load(simd, &self.angles, e).sin_cos();
            length.store(&mut self.length, e);
            self.tangent.store(tangent, e);
            self.director.store(d1, e);
            self.m1.store(d1 * cosine + d2 * sine, e);
            self.m2.store(d2 * cosine - d1 * sine, e);
        }
    }

    #[inline(always)]
    fn update_nodes<S: Simd>(&mut self, simd: S) {
        for i in (1..self.edges).step_by(S::F64_LANES) {
            let (before, after) = (self.tangent.load(simd, i - 1), self.tangent.load(simd, i));
            let inverse_chi = before.dot(after).plus_one().inverse();
            inverse_chi.store(&mut self.inverse_chi, i);
            self.binormal.store(before.cross(after) * inverse_chi.scaled(2.0), i);
            let carried = transport(self.director.load(simd, i - 1), before, after, inverse_chi);
            let d1 = self.director.load(simd, i);
            let wrapped = Wide::angle_of(d1.dot(after.cross(carried)), d1.dot(carried));
            let off = Wide::load(simd, &self.twist_before, i) - wrapped;
            let turns = off.scaled(1.0 / TAU).round();
            (wrapped + turns.scaled(TAU)).store(&mut self.reference_twist, i);
        }
    }

    /// Returns the material frames: tangents and both directors.
    pub fn axes(&self) -> [&Vectors; 3] {
        [&self.tangent, &self.m1, &self.m2]
    }

    /// Makes the frames at this shape the reference of later steps.
    pub fn accept(&self, reference: &mut ReferenceFrames) {
        self.tangent.copy_to(&mut reference.tangent);
        self.director.copy_to(&mut reference.director);
        let nodes = reference.twist.len();
        reference.twist.copy_from_slice(&self.reference_twist[..nodes]);
    }

    /// Returns the curvatures kappa1, kappa2 at an inner node (dimensionless).
    ///
    /// kappa1 = (m2_{i-1} + m2_i).kb/2, kappa2 = -(m1_{i-1} + m1_i).kb/2.
    #[inline(always)]
    pub fn curvature(&self, i: usize) -> [f64; 2] {
        let kb = self.binormal.at(i);
        [0.5 * kb.dot(&(self.m2.at(i - 1) + self.m2.at(i))), -0.5 * kb.dot(&(self.m1.at(i - 1) + self.m1.at(i)))]
    }

    /// Returns the twist in rad at an inner node: difference of the edge angles plus reference twist.
    #[inline(always)]
    pub fn twist(&self, i: usize, angles: &[f64]) -> f64 {
        angles[i] - angles[i - 1] + self.reference_twist[i]
    }
}

/// [`parallel_transport`] with 1/(1 + from.to) known.
#[inline(always)]
fn transport<S: Simd>(u: Wide3<S>, from: Wide3<S>, to: Wide3<S>, inverse_chi: Wide<S>) -> Wide3<S> {
    let axis = from.cross(to);
    axis.times_plus(axis.dot(u) * inverse_chi, u.times_plus(from.dot(to), axis.cross(u)))
}

/// Compiles the frames for the machine's vector instructions.
struct Update<'a>(&'a mut Frames);

impl Kernel for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.0.update_edges(simd);
        self.0.update_nodes(simd);
    }
}
