#pragma once
#include <ise/packet/schema.hpp>

namespace ise {

/// Turns packets in a writer's layout into a reader's, at any depth: fields that the writer lacks take the reader's
/// presets, those that the reader lacks are dropped, unknown enumerators stay numbers, unknown alternatives are errors.
/// Make one for a pair of schemas and keep it; it may be used from any thread.
class adapter {
public:
    /// Throws `type_mismatch` with the diff where the schemas are incompatible.
    adapter(schema writer, schema reader);

    /// Whether the layouts are the same: then nothing needs adapting.
    bool is_identity() const noexcept { return identity_; }

    /// Throws `malformed` naming the field where the bytes are none of the writer's, `too_large` beyond the limits.
    bytes operator()(bytes_view written, const decode_limits& limits = {}) const;
    void operator()(bytes_view written, buffer& out, const decode_limits& limits = {}) const;

private:
    schema writer_;
    schema reader_;
    bool identity_;
};

/// One packet turned; see `adapter`.
bytes adapt(const schema& writer, const schema& reader, bytes_view written, const decode_limits& limits = {});

} // namespace ise
