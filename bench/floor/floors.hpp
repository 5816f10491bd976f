#pragma once
#include "../support/report.hpp"

namespace bench {

/// Each pair: the serving side, which never returns normally, and the side that measures.
void serve_raw_call(const options&);
outcome raw_call(const options&);       ///< one outstanding: blocking; more: coalesced pipelining
void serve_raw_publish(const options&); ///< the publisher: batches of 64 KiB to each subscriber
outcome raw_publish(const options&);    ///< all subscribers of one process
void serve_raw_paced(const options&);   ///< a time stamp every millisecond
outcome raw_paced(const options&);
void serve_asio_call(const options&);
outcome asio_call(const options&); ///< a coroutine a side, no dispatch, no codec
outcome asio_post(const options&); ///< in process: a post to one's own executor and the resumption

} // namespace bench
