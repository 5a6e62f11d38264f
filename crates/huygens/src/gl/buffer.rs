//! Uniform blocks, and the buffer that holds a scene's vertices and indices.

use std::marker::PhantomData;
use std::rc::Rc;

use bytemuck::Pod;
use glow::HasContext;

use super::Context;
use super::program::BLOCKS;
use crate::{Error, Result};

/// A `repr(C)` struct that mirrors a std140 uniform block.
pub(crate) trait UniformBlock: Pod {
    /// Name of the block in GLSL, one of [`BLOCKS`].
    const NAME: &'static str;
    /// Names and offsets of the fields.
    #[cfg(test)]
    const FIELDS: &'static [(&'static str, usize)];
}

/// Declares a struct that mirrors a uniform block of vec4, uvec4 and mat4 members.
macro_rules! uniform_block {
    ($(#[$meta:meta])* $name:ident as $block:literal { $($field:ident: $type:ty),+ $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        pub(crate) struct $name { $(pub $field: $type),+ }

        impl $crate::gl::UniformBlock for $name {
            const NAME: &'static str = $block;
            #[cfg(test)]
            const FIELDS: &'static [(&'static str, usize)] =
                &[$((stringify!($field), std::mem::offset_of!($name, $field))),+];
        }
    };
}
pub(crate) use uniform_block;

/// A uniform buffer with one block.
pub(crate) struct Uniform<T>(UniformArray<T>);

impl<T: UniformBlock> Uniform<T> {
    /// Room for one block.
    pub fn new(context: &Rc<Context>) -> Result<Self> {
        UniformArray::new(context, &[T::zeroed()]).map(Self)
    }

    /// Writes the block and binds it for the draws that follow.
    pub fn set(&self, value: &T) {
        let gl = &self.0.context.gl;
        // SAFETY: see `Context::new`. A new store each time lets draws in flight keep the old one.
        unsafe {
            gl.bind_buffer(glow::UNIFORM_BUFFER, Some(self.0.raw));
            gl.buffer_data_u8_slice(glow::UNIFORM_BUFFER, bytemuck::bytes_of(value), glow::DYNAMIC_DRAW);
        }
        self.0.bind(0);
    }
}

/// A uniform buffer with many blocks, of which a draw sees one.
pub(crate) struct UniformArray<T> {
    context: Rc<Context>,
    raw: glow::Buffer,
    stride: usize,
    len: usize,
    binding: u32,
    block: PhantomData<T>,
}

impl<T: UniformBlock> UniformArray<T> {
    /// All the blocks.
    pub fn new(context: &Rc<Context>, values: &[T]) -> Result<Self> {
        let gl = &context.gl;
        // SAFETY: see `Context::new`.
        unsafe {
            let align = gl.get_parameter_i32(glow::UNIFORM_BUFFER_OFFSET_ALIGNMENT).max(1) as usize;
            let stride = size_of::<T>().next_multiple_of(align);
            let mut bytes = vec![0; stride * values.len()];
            for (chunk, value) in bytes.chunks_exact_mut(stride).zip(values) {
                chunk[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(value));
            }
            let raw = gl.create_buffer().map_err(Error::Gl)?;
            gl.bind_buffer(glow::UNIFORM_BUFFER, Some(raw));
            gl.buffer_data_u8_slice(glow::UNIFORM_BUFFER, &bytes, glow::STATIC_DRAW);
            let binding = BLOCKS.iter().position(|&name| name == T::NAME).expect("a block of the list") as u32;
            Ok(Self { context: context.clone(), raw, stride, len: values.len(), binding, block: PhantomData })
        }
    }

    /// Binds one block for the draws that follow.
    pub fn bind(&self, index: usize) {
        assert!(index < self.len);
        // SAFETY: see `Context::new`; the range lies within the buffer.
        unsafe {
            self.context.gl.bind_buffer_range(
                glow::UNIFORM_BUFFER,
                self.binding,
                Some(self.raw),
                (index * self.stride) as i32,
                size_of::<T>() as i32,
            );
        }
    }
}

impl<T> Drop for UniformArray<T> {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_buffer(self.raw) }
    }
}

/// Vertices and indices of all meshes, with the vertex array that reads them.
pub(crate) struct GeometryBuffer {
    context: Rc<Context>,
    array: glow::VertexArray,
    vertices: glow::Buffer,
    indices: glow::Buffer,
    /// Floats in all vertices.
    float_count: usize,
    index_count: usize,
}

impl GeometryBuffer {
    /// `attributes` lists the floats of each attribute in order; a vertex is their concatenation.
    pub fn new(context: &Rc<Context>, attributes: &[usize], vertices: &[f32], indices: &[u32]) -> Result<Self> {
        let floats: usize = attributes.iter().sum();
        let count = vertices.len() / floats;
        assert!(vertices.len().is_multiple_of(floats) && indices.iter().all(|&i| (i as usize) < count));
        let gl = &context.gl;
        // SAFETY: see `Context::new`; every index was checked against the vertices above.
        unsafe {
            let array = gl.create_vertex_array().map_err(Error::Gl)?;
            let vertex_buffer = gl.create_buffer().map_err(Error::Gl)?;
            let index_buffer = gl.create_buffer().map_err(Error::Gl)?;
            gl.bind_vertex_array(Some(array));
            gl.bind_buffer(glow::ARRAY_BUFFER, Some(vertex_buffer));
            gl.buffer_data_u8_slice(glow::ARRAY_BUFFER, bytemuck::cast_slice(vertices), glow::STATIC_DRAW);
            gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, Some(index_buffer));
            gl.buffer_data_u8_slice(glow::ELEMENT_ARRAY_BUFFER, bytemuck::cast_slice(indices), glow::STATIC_DRAW);
            let mut offset = 0;
            for (location, &size) in attributes.iter().enumerate() {
                gl.enable_vertex_attrib_array(location as u32);
                let stride = 4 * floats as i32;
                gl.vertex_attrib_pointer_f32(location as u32, size as i32, glow::FLOAT, false, stride, offset);
                offset += 4 * size as i32;
            }
            gl.bind_vertex_array(None);
            let buffer = Self {
                context: context.clone(),
                array,
                vertices: vertex_buffer,
                indices: index_buffer,
                float_count: vertices.len(),
                index_count: indices.len(),
            };
            context.memory.set(context.memory.get() + buffer.bytes());
            context.check("uploading the geometry")?;
            Ok(buffer)
        }
    }

    fn bytes(&self) -> u64 {
        4 * (self.float_count + self.index_count) as u64
    }

    /// Puts other vertices in the place of those from the float `first` on.
    pub fn set_vertices(&self, first: usize, vertices: &[f32]) {
        assert!(first + vertices.len() <= self.float_count);
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`; the range lies within the buffer.
        unsafe {
            gl.bind_buffer(glow::ARRAY_BUFFER, Some(self.vertices));
            gl.buffer_sub_data_u8_slice(glow::ARRAY_BUFFER, (first * 4) as i32, bytemuck::cast_slice(vertices));
        }
    }

    /// Makes it the source of [`GeometryBuffer::draw`].
    pub fn bind(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.context.gl.bind_vertex_array(Some(self.array)) }
    }

    /// Draws triangles from a range of the indices; the buffer must be bound.
    pub fn draw(&self, first: usize, count: usize) {
        assert!(first + count <= self.index_count);
        // SAFETY: see `Context::new`; the range lies within the buffer.
        unsafe {
            self.context.gl.draw_elements(glow::TRIANGLES, count as i32, glow::UNSIGNED_INT, (first * 4) as i32);
        }
    }
}

impl Drop for GeometryBuffer {
    fn drop(&mut self) {
        self.context.memory.set(self.context.memory.get().saturating_sub(self.bytes()));
        // SAFETY: see `Context::new`; all are ours.
        unsafe {
            self.context.gl.delete_vertex_array(self.array);
            self.context.gl.delete_buffer(self.vertices);
            self.context.gl.delete_buffer(self.indices);
        }
    }
}
