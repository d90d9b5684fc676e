//! Which triangles are there for no ray: twin of `shaders/trace/hidden.wgsl`.

/// Whether a triangle is hidden, of `hidden`: global ids, ascending, at which hiding begins and ends in turns.
#[inline(always)]
pub fn is_hidden(hidden: &[u32], id: u32) -> bool {
    !hidden.is_empty() && hidden.partition_point(|&bound| bound <= id) % 2 == 1
}
