#pragma once
#include <ise/net/connection.hpp>
#include <ise/session/schema_cache.hpp>

#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

namespace ise {

/// Asks the peer of one session for the texts of schemas that are not known here, and answers its questions.
class schema_exchange {
public:
    using ready = std::function<void(const std::vector<schema>&)>;
    using failed = std::function<void(const failure&)>;

    /// `max_bytes`: of memory, for all schemas that the peer sends, or that its questions hold.
    schema_exchange(schema_cache& book, net::connection& connection, std::size_t max_bytes)
        : book_(book), connection_(connection), max_bytes_(max_bytes) {}

    /// Calls `then` with the schemas in order, at once if all are known, else when the peer has told them.
    /// errc::type_mismatch if it does not know its own, errc::malformed if its text is no schema, errc::overloaded
    /// where it has told of too much, or left too much open. Nothing is called any more once the session is gone.
    void need(const std::vector<std::uint64_t>& fingerprints, ready then, failed otherwise);

    result<void> on_request(bytes_view body);
    result<void> on_answer(bytes_view body);

private:
    struct question {
        std::vector<std::uint64_t> fingerprints;
        std::vector<std::optional<schema>> schemas; // as many
        ready then;
        failed otherwise;
    };
    bool asked_for(std::uint64_t fingerprint) const;
    const schema* find(std::uint64_t fingerprint) const;
    std::optional<failure> hold(const schema& one);
    static void hand_over(question& asked);

    schema_cache& book_;
    net::connection& connection_;
    std::size_t max_bytes_;
    std::vector<question> open_;
    std::unordered_map<std::uint64_t, schema> received_; // from the peer
    std::size_t held_bytes_ = 0;                         // of memory, for these
};

} // namespace ise
