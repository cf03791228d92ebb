//! Logs rewritten by another program.

use super::*;

/// Options with which another program writes a log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rewriting {
    pub chunks: bool,
    pub crcs: bool,
    pub index: bool,
    pub lz4: bool,
}

const LIBRARY: &str = "mcap go v1.7.0; biflag 0.1.0";

/// Rewrites a log as another program may: with an attached file, its own metadata and channel, and an undefined record.
pub(super) fn rewrite(log: &Path, how: Rewriting) -> Vec<u8> {
    let record = |op: u8, body: &[u8]| [&[op][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let crc = |bytes: &[u8]| if how.crcs { crc32fast::hash(bytes) } else { 0 }.to_le_bytes();
    let table = |name: &str, table: &Table| {
        let pairs: Vec<u8> = table.iter().flat_map(|(key, value)| [text(key), text(value)].concat()).collect();
        record(0x0C, &[text(name), (pairs.len() as u32).to_le_bytes().to_vec(), pairs].concat())
    };
    let mut records = Vec::new();
    let foreign = [&9u16.to_le_bytes()[..], &text("Camera"), &text("json"), &0u32.to_le_bytes()].concat();
    records.extend(record(0x03, &foreign));
    let channel =
        [&900u16.to_le_bytes()[..], &9u16.to_le_bytes(), &text("/camera"), &text("json"), &0u32.to_le_bytes()];
    records.extend(record(0x04, &channel.concat()));
    records.extend(record(0x05, &[&900u16.to_le_bytes()[..], &[0; 20], b"{}"].concat()));
    let mut metadata = table("robot arm", &Table::from([("serial".to_owned(), "7".to_owned())]));
    let mut scanner = Scanner::new(std::fs::File::open(log).unwrap()).unwrap();
    while let Some(piece) = scanner.next().unwrap() {
        match piece {
            Piece::Metadata(name, fields) => metadata.extend(table(&name, &fields)),
            Piece::Chunk(chunk) => chunk.for_each(|entry| match entry {
                Entry::Schema(header, data) => {
                    let head = [&header.id.to_le_bytes()[..], &text(&header.name), &text(&header.encoding)].concat();
                    records.extend(record(0x03, &[head, (data.len() as u32).to_le_bytes().to_vec(), data].concat()));
                }
                Entry::Channel(channel) => {
                    let ids = [channel.id.to_le_bytes(), channel.schema_id.to_le_bytes()].concat();
                    let texts = [text(&channel.topic), text(&channel.message_encoding), vec![0; 4]].concat();
                    records.extend(record(0x04, &[ids, texts].concat()));
                }
                Entry::Message(header, data) => {
                    let ids = [&header.channel_id.to_le_bytes()[..], &header.sequence.to_le_bytes()].concat();
                    let times = [header.log_time.to_le_bytes(), header.publish_time.to_le_bytes()].concat();
                    records.extend(record(0x05, &[ids, times, data].concat()));
                }
            }),
            Piece::Attachment(..) => unreachable!("biflag attaches nothing"),
        }
    }
    let mut file = mcap::MAGIC.to_vec();
    file.extend(record(0x01, &[text(""), text(LIBRARY)].concat()));
    let attached = [&[0; 16][..], &text("plan.pdf"), &text("application/pdf"), &3u64.to_le_bytes(), b"pdf"].concat();
    file.extend(record(0x09, &[attached.clone(), crc(&attached).to_vec()].concat()));
    file.extend(record(0x90, b"of a private kind"));
    if how.chunks {
        let (name, packed) = match how.lz4 {
            true => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                std::io::Write::write_all(&mut encoder, &records).unwrap();
                ("lz4", encoder.finish().unwrap())
            }
            false => ("", records.clone()),
        };
        let sizes = [&[0; 16][..], &(records.len() as u64).to_le_bytes(), &crc(&records), &text(name)].concat();
        file.extend(record(0x06, &[sizes, (packed.len() as u64).to_le_bytes().to_vec(), packed].concat()));
    } else {
        file.extend(records);
    }
    let metadata_at = file.len() as u64;
    file.extend(&metadata);
    file.extend(record(0x0F, &crc(&file)));
    let start = file.len() as u64;
    let mut summary = Vec::new();
    let mut at = metadata_at;
    let mut rest = metadata.as_slice();
    while let (true, Some((head, body))) = (how.index, rest.split_first_chunk::<9>()) {
        let length = u64::from_le_bytes(head[1..].try_into().unwrap());
        let name = u32::from_le_bytes(body[..4].try_into().unwrap()) as usize;
        summary.extend(record(0x0D, &[&at.to_le_bytes()[..], &(9 + length).to_le_bytes(), &body[..4 + name]].concat()));
        (at, rest) = (at + 9 + length, &body[length as usize..]);
    }
    let footer = [if how.index { start } else { 0 }.to_le_bytes(), [0; 8]].concat();
    let head = [&[0x02][..], &20u64.to_le_bytes()].concat();
    let checked = crc(&[summary.clone(), head, footer.clone()].concat());
    file.extend(summary);
    file.extend(record(0x02, &[footer, checked.to_vec()].concat()));
    file.extend(mcap::MAGIC);
    file
}

fn all_rewritings() -> impl Iterator<Item = Rewriting> {
    (0..16).map(|bits: u8| {
        let [chunks, crcs, index, lz4] = [1, 2, 4, 8].map(|bit| bits & bit != 0);
        Rewriting { chunks, crcs, index, lz4 }
    })
}

/// Any valid MCAP file with our channels can be read, from any program.
#[test]
fn log_rewritten_by_another_program_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let [path, theirs, copy] = ["a.mcap", "b.mcap", "c.mcap"].map(|name| folder.path().join(name));
    write(&path, 8);
    let ours: Vec<Message> = Reader::open(&path).unwrap().map(Result::unwrap).collect();
    for how in all_rewritings() {
        std::fs::write(&theirs, rewrite(&path, how)).unwrap();
        let mut reader = Reader::open(&theirs).unwrap();
        let messages = reader.by_ref().map(Result::unwrap).filter(|message| message.topic != "/camera");
        assert_eq!(messages.collect::<Vec<_>>(), ours, "{how:?}");
        assert_eq!((reader.condition(), reader.losses()), (Some(Condition::Rewritten), &[][..]), "{how:?}");
        assert_eq!(reader.rewritten_by(), Some(LIBRARY));
        assert_eq!(reader.counts["/camera"], 1);
        assert_eq!(reader.meta::<TrialMeta>().unwrap(), start().trial);
        assert_eq!(summary(&theirs).unwrap(), Some(summary_of_trial()), "{how:?}");
        assert_eq!(last_meta::<RecoveryMeta>(&theirs).unwrap(), None);
        assert!(check(&theirs).unwrap().is_empty());

        let recovery = recover(&theirs, &copy).unwrap();
        assert_eq!((recovery.messages, recovery.losses.len()), (ours.len() as u64 + 1, 0), "{how:?}");
        assert_eq!(check(&copy).unwrap(), []);
        let copied = std::fs::read(&copy).unwrap();
        assert!(copied.windows(8).any(|bytes| bytes == b"plan.pdf"), "the attachment is copied");
        std::fs::remove_file(&copy).unwrap();
    }
}

/// A rewritten log without CRCs is incomplete if it ends early or its structure is wrong.
#[test]
fn rewritten_log_that_is_cut_is_not_whole() {
    let folder = tempfile::tempdir().unwrap();
    let [path, theirs] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    write(&path, 8);
    for how in all_rewritings() {
        let whole = rewrite(&path, how);
        std::fs::write(&theirs, &whole).unwrap();
        let file = std::fs::File::options().write(true).open(&theirs).unwrap();
        // From the end, so that one file can be cut repeatedly.
        for cut in (0..whole.len()).step_by(211).chain(whole.len() - 60..whole.len()).rev() {
            file.set_len(cut as u64).unwrap();
            match check(&theirs) {
                Ok(losses) => assert!(!losses.is_empty(), "{how:?} cut at {cut}"),
                Err(LogError::Empty { .. } | LogError::NothingLeft { .. } | LogError::NotOurs { .. }) => {}
                Err(error) => panic!("{how:?} cut at {cut}: {error}"),
            }
            assert_eq!(summary(&theirs).unwrap(), None, "{how:?} cut at {cut}");
        }
    }
    // With CRCs, a changed byte is detected.
    let how = Rewriting { chunks: false, crcs: true, index: true, lz4: false };
    let whole = rewrite(&path, how);
    for at in (0..whole.len()).step_by(53) {
        let mut broken = whole.clone();
        broken[at] ^= 0x10;
        std::fs::write(&theirs, broken).unwrap();
        assert!(check(&theirs).map_or(true, |losses| !losses.is_empty()), "byte {at}");
    }
}

/// An original without a CRC is damaged, although other programs may omit it.
#[test]
fn original_log_without_a_crc_is_damaged() {
    let log = bytes_of_log(8);
    let (range, _) = &chunks(&log)[1];
    let mut broken = log.clone();
    broken[range.start + 33..range.start + 37].fill(0);
    assert_eq!(read(&broken).1, Condition::Damaged);
    let data_end = log.windows(9).rposition(|head| head == [0x0F, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let mut broken = log.clone();
    broken[data_end + 9..data_end + 13].fill(0);
    assert_ne!(read(&broken).1, Condition::Clean);
}

#[test]
fn message_that_cannot_be_decoded_damages_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, 100);
    let mut bytes = rewrite(&path, Rewriting { chunks: false, crcs: false, index: false, lz4: false });
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(check_by_reading(&path), (Condition::Rewritten, 0));
    // A message's record has a length, its channel, a number and two times before the content. No field has the wire type 7.
    const EVENT: [u8; 2] = [6, 0];
    let event = bytes.windows(11).position(|bytes| bytes[0] == 0x05 && bytes[9..] == EVENT).unwrap();
    bytes[event + 31] = 0x07;
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(check_by_reading(&path), (Condition::Damaged, 1));
}

/// Such a message damages the log on any channel, whichever channels are read.
#[test]
fn message_of_each_channel_that_cannot_be_decoded_damages_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, 8);
    let bytes = rewrite(&path, Rewriting { chunks: false, crcs: false, index: false, lz4: false });
    let data_end = bytes.windows(9).rposition(|head| head == [0x0F, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let with = |channel: u16| {
        let message = [&channel.to_le_bytes()[..], &[0; 20], &[0x07]].concat();
        let record = [&[0x05][..], &(message.len() as u64).to_le_bytes(), &message].concat();
        std::fs::write(&path, [&bytes[..data_end], &record, &bytes[data_end..]].concat()).unwrap();
        let mut some = Reader::open(&path).unwrap().only(vec!["/event"]);
        some.by_ref().for_each(|message| drop(message.unwrap()));
        assert_eq!(some.losses(), check(&path).unwrap(), "channel {channel}");
        some.losses().len()
    };
    for spec in crate::schema::CHANNELS {
        assert_eq!(with(spec.id), 1, "{}", spec.topic);
    }
    assert_eq!(with(900), 0, "a channel of another program");
}

/// A known channel of another type cannot be read, and counts as damage.
#[test]
fn channel_of_another_type_damages_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, 8);
    let mut bytes = rewrite(&path, Rewriting { chunks: false, crcs: false, index: false, lz4: false });
    let name = b"biflag.Telemetry";
    let schema = bytes.windows(name.len()).position(|window| window == name).unwrap();
    bytes[schema + name.len() - 1] = b'x';
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(check_by_reading(&path), (Condition::Damaged, 1));
}

/// Returns a log's condition and number of losses after its last message.
fn check_by_reading(path: &Path) -> (Condition, usize) {
    let mut reader = Reader::open(path).unwrap();
    reader.by_ref().for_each(|message| drop(message.unwrap()));
    (reader.condition().unwrap(), reader.losses().len())
}
