#pragma once

namespace ise {

/// Beside `stream`, the type of one whose ends have proved the shared key to each other before the first byte of it
/// moves, and between which nobody can read or change a byte (FORMAT.md, section 17).
class sealed_stream {
protected:
    ~sealed_stream() = default;
};

} // namespace ise
