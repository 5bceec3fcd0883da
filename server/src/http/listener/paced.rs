//! The byte stream of a connection, with a minimum rate at which the client reads.
//!
//! hyper drops the body of an answer when it has taken its last part, possibly long before the client has
//! read it. A client that reads some bytes per second would keep its connection for hours: the system's
//! timeout only ends connections whose peer acknowledges nothing.

use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep};

use crate::state::connections::ConnectionSlot;

/// Minimum rate at which a client reads an answer, on average over the body timeout.
const MIN_BYTES_PER_S: f64 = 2048.0;

/// Maximum of bytes that the system takes before it can send them. Without it, megabytes would count as read.
/// The remaining steps of about 100 kB let any client pass that reads four times faster than the minimum.
#[cfg(target_os = "linux")]
const MAX_UNSENT_BYTES: u32 = 32 * 1024;

/// A stream that fails when its peer reads too slowly.
pub(super) struct Paced {
    stream: TcpStream,
    slot: Arc<ConnectionSlot>,
    /// Time over which the rate of reading is averaged.
    window: Duration,
    /// Present while bytes wait to be written.
    blocked: Option<Blocked>,
}

/// Progress within one window.
struct Blocked {
    written: usize,
    ends: Pin<Box<Sleep>>,
}

impl Paced {
    pub(super) fn new(stream: TcpStream, slot: Arc<ConnectionSlot>, window: Duration) -> Self {
        #[cfg(target_os = "linux")]
        if let Err(error) = socket2::SockRef::from(&stream).set_tcp_notsent_lowat(MAX_UNSENT_BYTES) {
            tracing::debug!(%error, "a connection has no TCP_NOTSENT_LOWAT");
        }
        Self { stream, slot, window, blocked: None }
    }

    fn pace(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<usize>>,
    ) -> Poll<io::Result<usize>> {
        if let Poll::Ready(written) = written {
            if let (Some(blocked), Ok(bytes)) = (&mut self.blocked, &written) {
                blocked.written += bytes;
            }
            return Poll::Ready(written);
        }
        let window = self.window;
        let blocked =
            self.blocked.get_or_insert_with(|| Blocked { written: 0, ends: Box::pin(sleep(window)) });
        while blocked.ends.as_mut().poll(context).is_ready() {
            if (blocked.written as f64) < MIN_BYTES_PER_S * window.as_secs_f64() {
                return Poll::Ready(Err(io::Error::new(
                    io::ErrorKind::TimedOut,
                    "the client reads too slowly",
                )));
            }
            blocked.written = 0;
            blocked.ends.as_mut().reset(Instant::now() + window);
        }
        Poll::Pending
    }
}

impl AsyncRead for Paced {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Paced {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.pace(context, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, parts);
        self.pace(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    /// hyper flushes when it has written everything.
    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.blocked = None;
        self.slot.note_written();
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;
    use tokio::time::timeout;

    use super::*;
    use crate::state::Connections;

    /// The end of writing to a client that reads `bytes` every 50 ms; none if it goes on for `limit_s`. The timeout of the
    /// system is not set here.
    async fn written_to(bytes: usize, window_s: u64, limit_s: u64) -> Option<io::Result<()>> {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        let slot = Arc::new(Connections::new(4)).enter().unwrap();
        let (stream, _) = listener.accept().await.unwrap();
        let mut stream = Paced::new(stream, slot, Duration::from_secs(window_s));
        let reading = tokio::spawn(async move {
            let mut buffer = vec![0; bytes];
            while client.read(&mut buffer).await.is_ok_and(|read| read > 0) {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        });
        let written = timeout(Duration::from_secs(limit_s), stream.write_all(&vec![1; 64 << 20])).await;
        reading.abort();
        written.ok()
    }

    #[tokio::test]
    async fn slow_reader_is_cut_off_and_steady_reader_is_not() {
        let (slow, steady) = tokio::join!(written_to(10, 1, 60), written_to(50_000, 5, 12));
        assert_eq!(slow.unwrap().unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert!(steady.is_none(), "{steady:?}");
    }
}
