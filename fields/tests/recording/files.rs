//! Files that were cut off or damaged.

use umbriel_fields::record::{Replayer, summary};

use crate::support::{Random, native_types, play, random_recording};

#[test]
fn a_recording_that_was_cut_off_is_good_up_to_there() {
    let (bytes, ..) = random_recording(7, 5, 12, 5);
    let mut reached = 0;
    for end in 0..bytes.len() {
        let Ok((mut replayer, mut graph)) = Replayer::open(&bytes[..end], native_types(1)) else {
            assert_eq!(reached, 0, "what could be opened shorter can be opened longer: {end} bytes");
            continue;
        };
        if end % 7 == 0 || replayer.frames() > reached {
            assert_eq!(play(&mut replayer, &mut graph), None);
        }
        let said = replayer.truncated().unwrap();
        assert!(said.contains(&format!("good up to frame {}", replayer.frames())), "{said}");
        assert!(summary(&bytes[..end]).unwrap().truncated.is_some());
        reached = replayer.frames();
    }
    assert_eq!(reached, 12);
    let (replayer, _) = Replayer::open(&bytes[..], native_types(1)).unwrap();
    assert_eq!(replayer.truncated(), None);
    let (replayer, _) = Replayer::open(&bytes[..bytes.len() - 5], native_types(1)).unwrap();
    println!("{}", replayer.truncated().unwrap());
}

#[test]
fn damage_is_noticed() {
    let (bytes, ..) = random_recording(8, 5, 12, 5);
    let mut random = Random(3);
    for _ in 0..600 {
        let mut damaged = bytes.clone();
        let place = random.below(bytes.len());
        damaged[place] ^= 1 << random.below(8);
        // The head is not under a checksum; a later minor version is fine.
        if let Ok((mut replayer, mut graph)) = Replayer::open(&damaged[..], native_types(1)) {
            assert!(replayer.truncated().is_some() || (10..12).contains(&place), "byte {place}");
            assert_eq!(play(&mut replayer, &mut graph), None, "what is left is right");
        }
    }
}

/// With checksums that fit, nothing protects but what is checked while reading.
#[test]
fn forged_blocks_do_no_harm() {
    let (bytes, ..) = random_recording(9, 10, 8, 4);
    let mut blocks = Vec::new();
    let mut at = 12;
    while at < bytes.len() {
        let length = u32::from_le_bytes(bytes[at + 1..at + 5].try_into().unwrap()) as usize;
        blocks.push((at, length));
        at += 13 + length;
    }
    let mut random = Random(4);
    let (mut opened, mut diverged) = (0, 0);
    for _ in 0..1500 {
        let mut forged = bytes.clone();
        let (block, length) = random.pick(&blocks).unwrap();
        if length == 0 {
            continue;
        }
        for _ in 0..1 + random.below(2) {
            forged[block + 13 + random.below(length)] = random.next() as u8;
        }
        let payload = &forged[block + 13..block + 13 + length];
        let checksum = xxhash_rust::xxh3::xxh3_64_with_seed(payload, forged[block] as u64).to_le_bytes();
        forged[block + 5..block + 13].copy_from_slice(&checksum);
        let _ = summary(&forged[..]);
        let Ok((mut replayer, mut graph)) = Replayer::open(&forged[..], native_types(1)) else { continue };
        opened += 1;
        loop {
            match replayer.step(&mut graph) {
                Ok(Some(replayed)) if replayed.divergence.is_some() => {
                    diverged += 1;
                    break;
                }
                Ok(Some(_)) => {}
                Ok(None) | Err(_) => break,
            }
        }
    }
    println!("{opened} of 1500 could be opened, {diverged} diverged");
    assert!(opened > 100 && diverged > 50);
}

#[test]
fn what_is_no_recording_is_refused() {
    let later = [&b"\x89UMBREC\n"[..], &[2, 0, 5, 0]].concat();
    for (bytes, expected) in [
        (&b""[..], "this is no recording"),
        (b"(format: \"umbriel-world\")", "this is no recording"),
        (&later, "the recording has format version 2.5; versions from 1.0 on up to the next major one can be read"),
        (b"\x89UMBREC\n\x01\x00\x00\x00", "the recording is damaged: there is no keyframe"),
    ] {
        assert_eq!(Replayer::open(bytes, native_types(1)).err().unwrap().to_string(), expected);
    }
}
