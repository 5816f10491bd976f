#pragma once
#include <ise/packet/schema.hpp>

namespace ise {

/// Converts packets from a writer's layout to a reader's, at any depth: missing fields take the reader's
/// presets, unknown fields are dropped, unknown enumerators stay numbers, unknown alternatives are errors.
/// Make one per pair of schemas and keep it; it may be used from any thread.
class adapter {
public:
    /// Throws `type_mismatch` with the diff if the schemas are incompatible.
    adapter(schema writer, schema reader);

    /// Whether the layouts are the same: then no conversion is needed.
    bool is_identity() const noexcept { return identity_; }

    /// Throws `malformed` with the field if the bytes do not match the writer's schema, `too_large` beyond the limits.
    bytes operator()(bytes_view written, const decode_limits& limits = {}) const;
    void operator()(bytes_view written, buffer& out, const decode_limits& limits = {}) const;

private:
    schema writer_;
    schema reader_;
    bool identity_;
};

/// Converts one packet; see `adapter`.
bytes adapt(const schema& writer, const schema& reader, bytes_view written, const decode_limits& limits = {});

} // namespace ise
