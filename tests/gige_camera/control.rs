//! The control channel: one answer for each command.

use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::Sender;
use std::time::Instant;

use super::registers::{
    PACKET_SIZE, PIXEL_FORMAT, PRIVILEGE, Registers, START, STOP, TIMESTAMP_CONTROL, TRIGGER,
};
use super::{Shared, pixels};

const DISCOVERY: u16 = 0x02;
const RESEND: u16 = 0x40;
const READ_REGISTER: u16 = 0x80;
const WRITE_REGISTER: u16 = 0x82;
const READ_MEMORY: u16 = 0x84;
const WRITE_MEMORY: u16 = 0x86;

const OK: u16 = 0;
const NOT_IMPLEMENTED: u16 = 0x8001;
const INVALID_PARAMETER: u16 = 0x8002;
const INVALID_ADDRESS: u16 = 0x8003;
const ACCESS_DENIED: u16 = 0x8006;

pub fn serve(shared: &Shared, socket: &UdpSocket, triggers: &Sender<()>) {
    let mut buffer = [0; 2048];
    while !shared.stops() {
        let received = socket.recv_from(&mut buffer);
        shared.registers().expire();
        let Ok((length, from)) = received else { continue };
        let datagram = &buffer[..length];
        if length < 8 || datagram[0] != 0x42 {
            continue;
        }
        let word = |at: usize| u16::from_be_bytes([datagram[at], datagram[at + 1]]);
        let (command, number, payload) = (word(2), word(6), &datagram[8..]);
        if command == RESEND {
            resend(shared, payload);
            continue;
        }
        let (status, answer) = execute(shared, command, payload, from, triggers);
        let mut reply = Vec::with_capacity(8 + answer.len());
        for half in [status, command + 1, answer.len() as u16, number] {
            reply.extend(half.to_be_bytes());
        }
        reply.extend(answer);
        let _ = socket.send_to(&reply, from);
    }
}

fn execute(
    shared: &Shared,
    command: u16,
    payload: &[u8],
    from: SocketAddr,
    triggers: &Sender<()>,
) -> (u16, Vec<u8>) {
    let mut registers = shared.registers();
    if let Some((owner, heard)) = &mut registers.owner
        && *owner == from
    {
        *heard = Instant::now();
    }
    let words: Vec<u32> = payload.as_chunks::<4>().0.iter().map(|&bytes| u32::from_be_bytes(bytes)).collect();
    // Whoever has exclusive access shares not even reading.
    let is_exclusive =
        registers.get(PRIVILEGE) & 1 != 0 && registers.owner.is_some_and(|(owner, _)| owner != from);
    match command {
        READ_REGISTER | READ_MEMORY if is_exclusive => (ACCESS_DENIED, Vec::new()),
        DISCOVERY => (OK, registers.read(0, 248).expect("there is that much").to_vec()),
        READ_REGISTER => {
            let mut answer = Vec::new();
            for &at in &words {
                let Some(value) = registers.read(at, 4) else { return (INVALID_ADDRESS, Vec::new()) };
                answer.extend_from_slice(value);
            }
            (OK, answer)
        }
        READ_MEMORY if words.len() == 2 => match registers.read(words[0], (words[1] & 0xFFFF) as usize) {
            Some(value) => (OK, [&words[0].to_be_bytes(), value].concat()),
            None => (INVALID_ADDRESS, Vec::new()),
        },
        WRITE_REGISTER => {
            for pair in words.chunks_exact(2) {
                let status = write(shared, &mut registers, pair[0], &pair[1].to_be_bytes(), from, triggers);
                if status != OK {
                    return (status, vec![0; 4]);
                }
            }
            (OK, ((words.len() / 2) as u32).to_be_bytes().to_vec())
        }
        WRITE_MEMORY if !words.is_empty() => {
            let bytes = &payload[4..];
            let status = write(shared, &mut registers, words[0], bytes, from, triggers);
            (status, (bytes.len() as u32).to_be_bytes().to_vec())
        }
        _ => (NOT_IMPLEMENTED, Vec::new()),
    }
}

fn write(
    shared: &Shared,
    registers: &mut Registers,
    at: u32,
    bytes: &[u8],
    from: SocketAddr,
    triggers: &Sender<()>,
) -> u16 {
    let owned = registers.owner.is_some_and(|(owner, _)| owner == from);
    if registers.owner.is_some() && !owned || registers.owner.is_none() && at != PRIVILEGE {
        return ACCESS_DENIED;
    }
    let value = bytes.first_chunk::<4>().map_or(0, |&bytes| u32::from_be_bytes(bytes));
    match at {
        PRIVILEGE => {
            registers.owner = (value & 3 != 0).then(|| (from, Instant::now()));
            registers.acquiring &= registers.owner.is_some();
            registers.set(PRIVILEGE, value & 3);
            OK
        }
        PACKET_SIZE => {
            registers.set(PACKET_SIZE, value & 0x4000_FFFF);
            if value & 0x8000_0000 != 0 {
                // Sends a test packet of this size, including the network's headers, so that the receiver sees whether it arrives.
                let size = ((value & 0xFFFF) as usize).saturating_sub(28);
                let _ = shared.stream.send_to(&vec![0; size], registers.destination());
            }
            OK
        }
        PIXEL_FORMAT if !pixels::is_offered(value) => INVALID_PARAMETER,
        TIMESTAMP_CONTROL => {
            if value & 2 != 0 {
                registers.set_wide(0x0948, shared.ticks());
            }
            OK
        }
        START => {
            registers.acquiring = true;
            registers.block = 0;
            registers.sent.clear();
            OK
        }
        STOP => {
            registers.acquiring = false;
            OK
        }
        TRIGGER => {
            // A trigger during an exposure is ignored, as by real cameras.
            if registers.acquiring && !registers.exposing {
                registers.exposing = true;
                let _ = triggers.send(());
            }
            OK
        }
        _ if registers.write(at, bytes) => OK,
        _ => INVALID_ADDRESS,
    }
}

fn resend(shared: &Shared, payload: &[u8]) {
    if payload.len() < 12 {
        return;
    }
    let block = u16::from_be_bytes([payload[2], payload[3]]);
    let packet =
        |at: usize| u32::from_be_bytes([0, payload[at + 1], payload[at + 2], payload[at + 3]]) as usize;
    let (first, last) = (packet(4), packet(8));
    let registers = shared.registers();
    let Some(sent) = registers.sent.iter().find(|sent| sent.block == block) else { return };
    for packet in sent.packets.iter().skip(first).take(last.saturating_sub(first) + 1) {
        let mut again = packet.clone();
        again[..2].copy_from_slice(&0x0100_u16.to_be_bytes());
        shared.send(&again, registers.destination());
    }
}
