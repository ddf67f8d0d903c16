//! Moves bytes for all connections at once, without ever waiting for one of them.
//!
//! One thread accepts, one reads and writes, a few answer. A connection has one request and one answer and so much time
//! for both; who is slow loses the connection, and nobody else notices.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::request::{HEAD_LIMIT, is_complete};
use super::response::{Body, Response, Status};

/// Threads that answer.
const WORKERS: usize = 4;
/// Connections at once; further ones are told to come back.
const CONNECTIONS: usize = 256;
/// Time for the whole request to arrive.
const REQUEST_TIME: Duration = Duration::from_secs(5);
/// Time for an answer to be taken, and for each mebibyte of it.
const ANSWER_TIME: Duration = Duration::from_secs(15);
/// Time between two looks at connections that were not ready.
const PAUSE: Duration = Duration::from_millis(4);
/// Bytes that are read from a file, or moved for a connection, at once.
const PIECE: usize = 64 << 10;

/// Makes an answer of the head of a request.
pub type Answer<'a> = dyn Fn(&[u8]) -> Response + Sync + 'a;

enum Event {
    Accepted(TcpStream),
    Answered(u64, Response),
}

/// Serves all connections of `listener`, until the process ends.
pub fn serve(listener: &TcpListener, answer: &Answer) -> ! {
    let (events, arriving) = channel();
    let (questions, asked) = sync_channel(CONNECTIONS);
    let asked = Mutex::new(asked);
    std::thread::scope(|scope| {
        for _ in 0..WORKERS {
            let (events, asked) = (events.clone(), &asked);
            scope.spawn(move || work(asked, &events, answer));
        }
        scope.spawn(move || Connections { open: BTreeMap::new(), next: 0, questions }.run(&arriving));
        accept(listener, &events)
    })
}

fn accept(listener: &TcpListener, events: &Sender<Event>) -> ! {
    loop {
        match listener.accept() {
            Ok((stream, _)) => drop(events.send(Event::Accepted(stream))),
            // The other side has left, or this process has too many files open: some will be closed soon.
            Err(_) => std::thread::sleep(PAUSE * 10),
        }
    }
}

fn work(asked: &Mutex<Receiver<(u64, Vec<u8>)>>, events: &Sender<Event>, answer: &Answer) {
    loop {
        let question = asked.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((id, head)) = question else { return };
        drop(events.send(Event::Answered(id, answer(&head))));
    }
}

/// A client.
struct Connection {
    stream: TcpStream,
    deadline: Instant,
    stage: Stage,
}

enum Stage {
    /// So much of the request has arrived.
    Reading(Vec<u8>),
    /// A worker has the request.
    Waiting,
    /// So much of `bytes` is sent; what follows comes from the file.
    Writing { bytes: Vec<u8>, sent: usize, file: Option<(std::fs::File, u64)> },
    /// All is sent; what the client still says is read and dropped until it closes.
    Closing,
}

/// Whether a connection had something to do.
enum Moved {
    Yes,
    No,
    /// It is done, or has failed.
    End,
}

struct Connections {
    open: BTreeMap<u64, Connection>,
    next: u64,
    questions: SyncSender<(u64, Vec<u8>)>,
}

impl Connections {
    fn run(mut self, arriving: &Receiver<Event>) {
        let mut moved = false;
        loop {
            // Without connections there is nothing to look at until one comes.
            let event = match (self.open.is_empty(), moved) {
                (true, _) => arriving.recv().map_err(|_| RecvTimeoutError::Disconnected),
                (false, true) => arriving.recv_timeout(Duration::ZERO),
                (false, false) => arriving.recv_timeout(PAUSE),
            };
            match event {
                Ok(event) => self.take(event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            arriving.try_iter().for_each(|event| self.take(event));
            moved = self.look_at_all();
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Accepted(stream) => {
                // A stream that cannot be set so would make all wait.
                if stream.set_nonblocking(true).is_err() {
                    return;
                }
                let stage = match self.open.len() < CONNECTIONS {
                    true => Stage::Reading(Vec::new()),
                    false if self.open.len() < 2 * CONNECTIONS => {
                        writing(Response::text(Status::Busy, "too many connections; try again"))
                    }
                    false => return,
                };
                let deadline = Instant::now() + REQUEST_TIME;
                self.open.insert(self.next, Connection { stream, deadline, stage });
                self.next += 1;
            }
            Event::Answered(id, response) => {
                if let Some(connection) = self.open.get_mut(&id) {
                    connection.answer(response);
                }
            }
        }
    }

    /// Does for each connection what can be done now; whether anything could.
    fn look_at_all(&mut self) -> bool {
        let (mut moved, now) = (false, Instant::now());
        let questions = &self.questions;
        self.open.retain(|id, connection| {
            if now >= connection.deadline && !connection.told_late() {
                return false;
            }
            match connection.look(*id, questions) {
                Moved::Yes => moved = true,
                Moved::No => {}
                Moved::End => return false,
            }
            true
        });
        moved
    }
}

/// An answer ready to be sent.
fn writing(response: Response) -> Stage {
    let mut bytes = response.head();
    let file = match response.body {
        _ if response.head_only => None,
        Body::Bytes(body) => {
            bytes.extend(body);
            None
        }
        Body::File(file, length) => Some((file, length)),
    };
    Stage::Writing { bytes, sent: 0, file }
}

impl Connection {
    fn answer(&mut self, response: Response) {
        self.deadline = Instant::now() + ANSWER_TIME * (1 + (response.length() >> 20) as u32);
        self.stage = writing(response);
    }

    /// The time is over: a client whose request is not complete is told so, and has the time of an answer for that.
    /// Whether there was something to tell.
    fn told_late(&mut self) -> bool {
        let asks = matches!(&self.stage, Stage::Reading(bytes) if !bytes.is_empty());
        if asks {
            self.answer(Response::text(Status::Timeout, "the request took too long"));
        }
        asks
    }

    fn look(&mut self, id: u64, questions: &SyncSender<(u64, Vec<u8>)>) -> Moved {
        match &mut self.stage {
            Stage::Reading(_) => self.read(id, questions),
            Stage::Waiting => Moved::No,
            Stage::Writing { .. } => self.write(),
            Stage::Closing => self.close(),
        }
    }

    fn read(&mut self, id: u64, questions: &SyncSender<(u64, Vec<u8>)>) -> Moved {
        let Stage::Reading(bytes) = &mut self.stage else { return Moved::No };
        let mut piece = [0; 4096];
        let complete = match self.stream.read(&mut piece) {
            Ok(0) => return Moved::End,
            Ok(n) => {
                // The end of the head may have begun with what came before.
                let looked_at = bytes.len().saturating_sub(3);
                bytes.extend(&piece[..n]);
                is_complete(&bytes[looked_at..])
            }
            Err(e) => return after(&e),
        };
        if complete && bytes.len() <= HEAD_LIMIT {
            let head = std::mem::take(bytes);
            self.stage = Stage::Waiting;
            self.deadline = Instant::now() + ANSWER_TIME * 4;
            if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = questions.try_send((id, head)) {
                self.answer(Response::text(Status::Busy, "too many requests; try again"));
            }
        } else if bytes.len() > HEAD_LIMIT {
            self.answer(Response::text(Status::HeadTooLarge, "the head of the request is too long"));
        }
        Moved::Yes
    }

    fn write(&mut self) -> Moved {
        let Stage::Writing { bytes, sent, file } = &mut self.stage else { return Moved::No };
        if *sent == bytes.len() {
            match next_piece(file) {
                Ok(Some(piece)) => (*bytes, *sent) = (piece, 0),
                Ok(None) => {
                    // What was sent arrives even if the client has said more than was read.
                    self.deadline = self.deadline.min(Instant::now() + REQUEST_TIME);
                    self.stage = Stage::Closing;
                    return if self.stream.shutdown(Shutdown::Write).is_ok() { Moved::Yes } else { Moved::End };
                }
                Err(_) => return Moved::End,
            }
        }
        let until = bytes.len().min(*sent + PIECE);
        match self.stream.write(&bytes[*sent..until]) {
            Ok(n) => {
                *sent += n;
                Moved::Yes
            }
            Err(e) => after(&e),
        }
    }

    fn close(&mut self) -> Moved {
        let mut piece = [0; 4096];
        match self.stream.read(&mut piece) {
            Ok(0) => Moved::End,
            Ok(_) => Moved::Yes,
            Err(e) => after(&e),
        }
    }
}

/// The next bytes of a file, `None` at its end. A file that has become shorter ends the connection.
fn next_piece(file: &mut Option<(std::fs::File, u64)>) -> std::io::Result<Option<Vec<u8>>> {
    let Some((open, left)) = file.as_mut().filter(|(_, left)| *left > 0) else { return Ok(None) };
    let mut piece = vec![0; PIECE.min(usize::try_from(*left).unwrap_or(PIECE))];
    open.read_exact(&mut piece)?;
    *left -= piece.len() as u64;
    Ok(Some(piece))
}

/// What follows from an error of a socket.
fn after(error: &std::io::Error) -> Moved {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::Interrupted => Moved::No,
        _ => Moved::End,
    }
}
