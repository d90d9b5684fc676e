//! Packed bytes: how what is read rarely lies in a file.
//!
//! | bytes | what |
//! | --- | --- |
//! | 4 | u32, length n of the block |
//! | n | an LZ4 block ("LZ4 Block Format Description", lz4/doc/lz4_Block_format.md) |
//! | up to 15 | zeros, so that the whole is a multiple of 16 |
//!
//! The length of what is packed is not part of it: whoever unpacks knows it from the counts in the file's records.
//! LZ4 turns long runs of repeated bytes into few and is decoded at several times the speed of a disk; what is packed
//! should be arranged accordingly.

/// Length of the word before the block.
const HEAD_BYTES: usize = 4;

/// Packed bytes come in multiples of this, as the payloads of a file do.
const PACKED_ALIGN: usize = 16;

/// Most bytes that a byte of a block unpacks to: a match of an LZ4 block takes three bytes, and one more for each 255
/// in its length.
pub const MAX_RATIO: u64 = 255;

/// Why bytes could not be unpacked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found}, expected {expected}")]
pub struct UnpackError {
    /// What is there.
    pub found: String,
    /// What the format asks for.
    pub expected: String,
}

/// Packs at most [`MAX_PAYLOAD_BYTES`](crate::layout::MAX_PAYLOAD_BYTES) bytes. The same bytes give the same packed
/// ones.
///
/// # Panics
///
/// If there are so many bytes that the length of the block is no u32.
pub fn pack(bytes: &[u8]) -> Vec<u8> {
    let longest = lz4_flex::block::get_maximum_output_size(bytes.len());
    assert!(u32::try_from(longest).is_ok(), "{} bytes are too many to pack", bytes.len());
    let mut packed = vec![0; HEAD_BYTES + longest];
    let (head, block) = packed.split_at_mut(HEAD_BYTES);
    let length = lz4_flex::block::compress_into(bytes, block).expect("the block has room for the longest outcome");
    head.copy_from_slice(&(length as u32).to_le_bytes());
    packed.truncate(HEAD_BYTES + length);
    packed.resize((HEAD_BYTES + length).next_multiple_of(PACKED_ALIGN), 0);
    packed.shrink_to_fit();
    packed
}

/// Unpacks what [`pack`] made of `out.len()` bytes. Whatever `packed` holds, it neither panics nor allocates but for
/// the words of the error; after an error the contents of `out` are of no use.
///
/// # Errors
///
/// If the block is longer than `packed`, is no block of LZ4 or one of another length than `out`, or if other than
/// fewer than 16 zeros follow it.
pub fn unpack(packed: &[u8], out: &mut [u8]) -> Result<(), UnpackError> {
    let Some((head, rest)) = packed.split_first_chunk::<HEAD_BYTES>() else {
        return Err(broken(format!("{} packed bytes", packed.len()), format!("at least {HEAD_BYTES}")));
    };
    let length = u32::from_le_bytes(*head);
    let Some((block, padding)) = rest.split_at_checked(length as usize) else {
        return Err(broken(format!("a block of {length} bytes"), format!("at most the {} there are", rest.len())));
    };
    if packed.len() != (HEAD_BYTES + block.len()).next_multiple_of(PACKED_ALIGN) {
        let expected = format!("the next multiple of {PACKED_ALIGN} after its block of {length}");
        return Err(broken(format!("{} packed bytes", packed.len()), expected));
    }
    if let Some(byte) = padding.iter().find(|&&byte| byte != 0) {
        return Err(broken(format!("{byte:#04x} after the block"), "zero padding".to_owned()));
    }
    match lz4_flex::block::decompress_into(block, out) {
        Ok(written) if written == out.len() => Ok(()),
        Ok(written) => Err(broken(format!("a block of {written} unpacked bytes"), out.len().to_string())),
        Err(error) => Err(broken(format!("an LZ4 block with {error}"), format!("one of {} unpacked bytes", out.len()))),
    }
}

#[cold]
fn broken(found: String, expected: String) -> UnpackError {
    UnpackError { found, expected }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unpacked(packed: &[u8], length: usize) -> Result<Vec<u8>, UnpackError> {
        // Stale bytes in the buffer, which must not show in what is unpacked.
        let mut out = vec![0xa5; length];
        unpack(packed, &mut out).map(|()| out)
    }

    #[test]
    fn repeated_bytes_become_few() {
        let bytes = [7; 100_000];
        let packed = pack(&bytes);
        assert!(packed.len() < 500 && packed.len().is_multiple_of(16), "{} bytes", packed.len());
        assert_eq!(unpacked(&packed, bytes.len()).unwrap(), bytes);
    }

    #[test]
    fn nothing_can_be_packed() {
        let packed = pack(&[]);
        assert_eq!(packed, [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(unpacked(&packed, 0), Ok(Vec::new()));
    }

    #[test]
    fn another_length_is_refused() {
        let packed = pack(&[7; 1000]);
        for length in [0, 1, 16, 999, 1001, 2000] {
            let error = unpacked(&packed, length).unwrap_err();
            assert!(error.to_string().contains(&length.to_string()), "{error}");
        }
    }

    #[test]
    fn damage_outside_of_the_block_is_refused() {
        let bytes: Vec<u8> = (0..=255).collect();
        let packed = pack(&bytes);
        let mut padded = packed.clone();
        let end = packed.len();
        // 256 different bytes are one run of literals: the token, the rest of its length (256 - 15), themselves.
        assert_eq!(packed[..4], 258u32.to_le_bytes());
        padded[end - 1] = 1;
        assert_eq!(unpacked(&padded, 256).unwrap_err().expected, "zero padding");
        for length in [0, 3, 4, end - 16, end - 1] {
            assert!(unpacked(&packed[..length], 256).is_err(), "{length} bytes");
        }
        let longer = [&packed[..], &[0; 16]].concat();
        assert!(unpacked(&longer, 256).unwrap_err().expected.contains("next multiple of 16"));
        let mut beyond = packed.clone();
        beyond[..4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(unpacked(&beyond, 256).unwrap_err().found.contains("a block of 4294967295 bytes"));
        assert_eq!(unpacked(&packed, 256).unwrap(), bytes);
    }

    proptest! {
        #[test]
        fn what_is_packed_comes_back(
            bytes in prop_oneof![
                prop::collection::vec(any::<u8>(), 0..2000),
                prop::collection::vec(0u8..3, 0..20_000),
                (prop::collection::vec(any::<u8>(), 1..100), 1usize..2000).prop_map(|(piece, n)| piece.repeat(n)),
            ]
        ) {
            let packed = pack(&bytes);
            prop_assert!(packed.len().is_multiple_of(16));
            prop_assert_eq!(&packed, &pack(&bytes));
            prop_assert_eq!(unpacked(&packed, bytes.len()).unwrap(), bytes);
        }

        #[test]
        fn any_bytes_are_unpacked_or_refused(
            bytes in prop::collection::vec(any::<u8>(), 0..300), length in 0usize..4000
        ) {
            let _ = unpacked(&bytes, length);
            // The same as a block with a right frame, so that it is decoded.
            let mut framed = (bytes.len() as u32).to_le_bytes().to_vec();
            framed.extend(&bytes);
            framed.resize(framed.len().next_multiple_of(16), 0);
            if let Ok(out) = unpacked(&framed, length) {
                prop_assert_eq!(out.len(), length);
            }
        }

        #[test]
        fn a_changed_byte_is_refused_or_changes_only_what_is_unpacked(
            bytes in prop::collection::vec(0u8..4, 1..3000), at in any::<prop::sample::Index>(), with in 1u8..=255
        ) {
            let mut packed = pack(&bytes);
            let at = at.index(packed.len());
            packed[at] ^= with;
            // Independent of what was in the buffer before.
            let mut out = vec![0; bytes.len()];
            let result = unpack(&packed, &mut out).map(|()| out);
            prop_assert_eq!(result, unpacked(&packed, bytes.len()));
        }
    }
}
