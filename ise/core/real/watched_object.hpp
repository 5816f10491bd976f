#pragma once
// `watched_object`: a descriptor as an object of Asio, which owns it and waits until it is ready. Made from an executor
// and the descriptor; has `async_wait`, `wait_read`, `wait_write` and `close`.
#if defined(_WIN32)
    #include <ise/core/real/windows/watched_object.hpp>
#else
    #include <ise/core/real/linux/watched_object.hpp>
#endif
