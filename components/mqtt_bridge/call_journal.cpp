#include <components/mqtt_bridge/call_journal.hpp>

#include <ise/packet/fingerprint.hpp>

#include <utility>
#include <vector>

namespace ise::mqtt {
namespace {

std::vector<std::byte> blob_of(const std::string& text) {
    const auto* begin = reinterpret_cast<const std::byte*>(text.data());
    return {begin, begin + text.size()};
}

std::int64_t milliseconds_of(wall_time at) {
    return std::chrono::duration_cast<std::chrono::milliseconds>(at.time_since_epoch()).count();
}

std::int64_t digest_of(const std::string& topic, const std::string& request) {
    return static_cast<std::int64_t>(fingerprint_of(topic + '\0' + request));
}

} // namespace

result<call_journal::finding> call_journal::begin(const std::string& key, const std::string& topic,
                                                  const std::string& request, wall_time now) {
    const auto digest = digest_of(topic, request);
    auto known = db_->query("SELECT digest, code, execution, payload FROM calls WHERE key = ?", {blob_of(key)});
    if (!known) return known.error();
    finding made;
    if (!known->empty()) {
        const auto& row = known->front();
        if (row.integer(0) != digest) {
            made.is = state::other;
        } else if (!row.is_null(1) && row.is_null(2)) {
            made.is = state::dropped;
        } else if (!row.is_null(1)) {
            made.is = state::answered;
            made.outcome.code = row.text(1);
            made.outcome.execution = row.text(2);
            auto raw = row.bytes(3);
            made.outcome.payload.assign(reinterpret_cast<const char*>(raw.data()), raw.size());
        } else {
            made.is = running_.contains(key) ? state::running : state::interrupted;
        }
        return made;
    }
    auto noted = db_->execute("INSERT INTO calls (key, digest, life, began) VALUES (?, ?, ?, ?)",
                              {blob_of(key), digest, life_, milliseconds_of(now)});
    if (!noted) return noted.error();
    running_.insert(key);
    return made;
}

result<void> call_journal::end(const std::string& key, const call_outcome& outcome) {
    auto noted = db_->execute("UPDATE calls SET code = ?, execution = ?, payload = ? WHERE key = ?",
                              {outcome.code, outcome.execution, blob_of(outcome.payload), blob_of(key)});
    running_.erase(key);
    if (!noted) return noted.error();
    if (kept_bytes_) *kept_bytes_ += static_cast<std::int64_t>(outcome.payload.size());
    return bound_answers();
}

// A quarter goes at once, so that it is seldom looked for. A request whose answer has gone is still not executed again.
result<void> call_journal::bound_answers() {
    if (!kept_bytes_) {
        auto sum = db_->query("SELECT coalesce(sum(length(payload)), 0) FROM calls");
        if (!sum) return sum.error();
        kept_bytes_ = sum->front().integer(0);
    }
    if (*kept_bytes_ <= answer_bytes_) return {};
    return db_->transaction([&]() -> result<void> {
        while (*kept_bytes_ > answer_bytes_ / 4 * 3) {
            auto oldest = db_->query("SELECT key, length(payload) FROM calls WHERE length(payload) > 0 ORDER BY began "
                                     "LIMIT 256");
            if (!oldest) return oldest.error();
            if (oldest->empty()) break;
            for (const auto& row : *oldest) {
                auto gone =
                    db_->execute("UPDATE calls SET execution = NULL, payload = NULL WHERE key = ?", {row.bytes(0)});
                if (!gone) return gone.error();
                *kept_bytes_ -= row.integer(1);
                if (*kept_bytes_ <= answer_bytes_ / 4 * 3) break;
            }
        }
        return {};
    });
}

result<void> call_journal::tidy(wall_time now) {
    auto old = db_->execute("DELETE FROM calls WHERE began < ? AND (code IS NOT NULL OR life <> ?)",
                            {milliseconds_of(now - remember_), life_});
    if (!old) return old.error();
    auto many =
        db_->execute("DELETE FROM calls WHERE key IN (SELECT key FROM calls WHERE code IS NOT NULL ORDER BY began "
                     "DESC LIMIT -1 OFFSET ?)",
                     {max_calls});
    if (!many) return many.error();
    if (*old + *many > 0) kept_bytes_.reset();
    return {};
}

} // namespace ise::mqtt
