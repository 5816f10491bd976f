#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/stream.hpp>

#include <string>
#include <string_view>

namespace atirma {

/// Bytes on their way into a stream that may not take all at once.
class outgoing {
public:
    void add(std::string_view bytes) { bytes_.append(bytes); }
    void add(ise::bytes_view bytes) { bytes_.append(ise::as_text(bytes)); }
    void clear() { bytes_.clear(); }
    std::size_t size() const noexcept { return bytes_.size(); }

    /// Writes what goes; no error where the rest has to wait.
    std::error_code write(ise::stream& to);

private:
    std::string bytes_;
};

} // namespace atirma
