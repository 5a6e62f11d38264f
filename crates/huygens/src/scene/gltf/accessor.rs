//! Typed arrays of a glTF file, read with every range checked.

use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index, Root, buffer};

use super::files::Files;
use super::{Problem, get};

/// Largest array that no data stands behind (zeros, to be filled by sparse values): a few bytes of JSON ask for it.
const MAX_ZEROS: usize = 1 << 24;

/// The buffers of a file, each loaded when first asked for.
pub(super) struct Buffers<'a> {
    pub(super) root: &'a Root,
    pub(super) bin: Option<&'a [u8]>,
    pub(super) loaded: Vec<Option<Vec<u8>>>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(root: &'a Root, bin: Option<&'a [u8]>) -> Self {
        Self { root, bin, loaded: vec![None; root.buffers.len()] }
    }

    /// Number of elements that an accessor says it has.
    pub(super) fn count(&self, index: Index<Accessor>) -> Problem<usize> {
        Ok(size(get(&self.root.accessors, index.value(), "accessor")?.count))
    }

    /// Bytes of a buffer view, and its stride.
    pub(super) fn view(&mut self, files: &mut Files, index: Index<buffer::View>) -> Problem<(&[u8], Option<usize>)> {
        let view = get(&self.root.buffer_views, index.value(), "bufferView")?;
        let number = view.buffer.value();
        let buffer = get(&self.root.buffers, number, "buffer")?;
        if self.loaded[number].is_none()
            && let Some(uri) = &buffer.uri
        {
            self.loaded[number] = Some(files.fetch(uri).map_err(|e| format!("buffer {number}: {e}"))?);
        }
        let bytes = match (&self.loaded[number], self.bin) {
            (Some(bytes), _) => bytes.as_slice(),
            (None, Some(bin)) if number == 0 => bin,
            _ => return Err(format!("buffer {number} has no URI; allowed: none for buffer 0 of a .glb only")),
        };
        let length = size(buffer.byte_length);
        let bytes = bytes.get(..length).ok_or_else(|| {
            format!(
                "buffer {number} is truncated: it has {} bytes; allowed: its byteLength, {length}, or more",
                bytes.len()
            )
        })?;
        let offset = size(view.byte_offset.unwrap_or_default());
        let bytes = slice(bytes, offset, size(view.byte_length))
            .ok_or_else(|| format!("bufferView {} is out of bounds; allowed: inside buffer {number}", index.value()))?;
        Ok((bytes, view.byte_stride.map(|s| s.0)))
    }

    /// Elements as numbers; integers become −1…1 or 0…1 where the accessor is normalised. Elements with fewer than
    /// `N` components are filled up with ones; `allowed` are the types that the attribute may have.
    pub(super) fn floats<const N: usize>(
        &mut self,
        files: &mut Files,
        index: Index<Accessor>,
        allowed: &[Type],
    ) -> Problem<Vec<[f32; N]>> {
        let accessor = get(&self.root.accessors, index.value(), "accessor")?;
        let (component, _) = self.kind(index, allowed)?;
        let convert: fn(&[u8]) -> f32 = match (component, accessor.normalized) {
            (ComponentType::I8, false) => |b| f32::from(b[0] as i8),
            (ComponentType::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
            (ComponentType::U8, false) => |b| f32::from(b[0]),
            (ComponentType::U8, true) => |b| f32::from(b[0]) / 255.0,
            (ComponentType::I16, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
            (ComponentType::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
            (ComponentType::U16, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
            (ComponentType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            (ComponentType::U32, false) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            (ComponentType::U32, true) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32 / u32::MAX as f32,
            (ComponentType::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        };
        let out: Vec<[f32; N]> = self.elements(files, index, allowed, convert, 1.0)?;
        match out.iter().flatten().all(|x| x.is_finite()) {
            true => Ok(out),
            false => Err(format!("accessor {}: NaN or infinite values; allowed: finite ones", index.value())),
        }
    }

    /// Indices of vertices.
    pub(super) fn indices(&mut self, files: &mut Files, index: Index<Accessor>) -> Problem<Vec<u32>> {
        let (component, _) = self.kind(index, &[Type::Scalar])?;
        let convert: fn(&[u8]) -> u32 = match component {
            ComponentType::U8 => |b| u32::from(b[0]),
            ComponentType::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            ComponentType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => {
                return Err(format!(
                    "accessor {}: indices of a type that is not unsigned; allowed: 5121, 5123, 5125",
                    index.value()
                ));
            }
        };
        let out: Vec<[u32; 1]> = self.elements(files, index, &[Type::Scalar], convert, 0)?;
        Ok(out.into_iter().flatten().collect())
    }

    fn kind(&self, index: Index<Accessor>, allowed: &[Type]) -> Problem<(ComponentType, usize)> {
        let accessor = get(&self.root.accessors, index.value(), "accessor")?;
        let Checked::Valid(GenericComponentType(component)) = accessor.component_type else {
            return Err(format!(
                "accessor {}: unknown componentType; allowed: 5120 to 5123, 5125, 5126",
                index.value()
            ));
        };
        match accessor.type_ {
            Checked::Valid(kind) if allowed.contains(&kind) => Ok((component, kind.multiplicity())),
            _ => {
                let allowed: Vec<_> = allowed.iter().map(|&kind| name(kind)).collect();
                let allowed = allowed.join(", ");
                Err(format!("accessor {}: a type that does not fit its use; allowed: {allowed}", index.value()))
            }
        }
    }

    fn elements<T: Copy + Default, const N: usize>(
        &mut self,
        files: &mut Files,
        index: Index<Accessor>,
        allowed: &[Type],
        convert: fn(&[u8]) -> T,
        fill: T,
    ) -> Problem<Vec<[T; N]>> {
        let number = index.value();
        let (component, width) = self.kind(index, allowed)?;
        let accessor = &self.root.accessors[number];
        let (step, element, count) = (component.size(), component.size() * width, size(accessor.count));
        let convert_element = |bytes: &[u8]| {
            let mut out = [fill; N];
            for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(step)) {
                *out = convert(bytes);
            }
            out
        };

        let mut out = Vec::new();
        if let Some(view) = accessor.buffer_view {
            let (bytes, stride) = self.view(files, view).map_err(|e| format!("accessor {number}: {e}"))?;
            let stride = stride.unwrap_or(element);
            if stride < element || stride > 252 {
                return Err(format!("accessor {number}: byteStride {stride}; allowed: {element} to 252"));
            }
            let length = count.saturating_sub(1).checked_mul(stride).and_then(|n| n.checked_add(element));
            let length = if count == 0 { Some(0) } else { length };
            let bytes = length
                .and_then(|length| slice(bytes, size(accessor.byte_offset.unwrap_or_default()), length))
                .ok_or_else(|| {
                    format!("accessor {number} is out of bounds; allowed: inside bufferView {}", view.value())
                })?;
            // The bytes are there, so `count` is as bounded as the file. The last chunk may be short of its stride.
            out.extend(bytes.chunks(stride).map(|chunk| convert_element(&chunk[..element])));
        } else {
            if count > MAX_ZEROS {
                return Err(format!("accessor {number}: {count} elements without data; allowed: {MAX_ZEROS}"));
            }
            let mut zero = [fill; N];
            zero[..width.min(N)].fill(T::default());
            out.resize(count, zero);
        }

        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(kind) = sparse.indices.component_type else {
                return Err(format!(
                    "accessor {number}: sparse indices of an unknown componentType; allowed: 5121, 5123, 5125"
                ));
            };
            let (width, count) = (kind.0.size(), size(sparse.count));
            let outside = || format!("accessor {number}: sparse data out of bounds; allowed: inside its bufferView");
            let mut part = |view, offset: USize64, width: usize| -> Problem<Vec<u8>> {
                let (bytes, _) = self.view(files, view).map_err(|e| format!("accessor {number}: {e}"))?;
                let bytes = count.checked_mul(width).and_then(|n| slice(bytes, size(offset), n));
                Ok(bytes.ok_or_else(outside)?.to_vec())
            };
            let indices = part(sparse.indices.buffer_view, sparse.indices.byte_offset, width)?;
            let values = part(sparse.values.buffer_view, sparse.values.byte_offset, element)?;
            for (at, value) in indices.chunks_exact(width).zip(values.chunks_exact(element)) {
                let at = at.iter().rev().fold(0_usize, |n, &byte| n << 8 | usize::from(byte));
                *out.get_mut(at).ok_or_else(|| {
                    format!("accessor {number}: sparse index {at} out of range; allowed: below {}", accessor.count.0)
                })? = convert_element(value);
            }
        }
        Ok(out)
    }
}

/// The name that a file has for a type.
pub(super) fn name(kind: Type) -> &'static str {
    match kind {
        Type::Scalar => "SCALAR",
        Type::Vec2 => "VEC2",
        Type::Vec3 => "VEC3",
        Type::Vec4 => "VEC4",
        Type::Mat2 => "MAT2",
        Type::Mat3 => "MAT3",
        Type::Mat4 => "MAT4",
    }
}

/// A size of the file; one beyond the address space is out of every bound.
fn size(n: USize64) -> usize {
    usize::try_from(n.0).unwrap_or(usize::MAX)
}

fn slice(bytes: &[u8], offset: usize, length: usize) -> Option<&[u8]> {
    bytes.get(offset..offset.checked_add(length)?)
}
