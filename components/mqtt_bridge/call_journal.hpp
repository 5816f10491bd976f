#pragma once
#include <ise/database/database.hpp>

#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>

namespace ise::mqtt {

/// The answer to a request.
struct call_outcome {
    std::string code;      ///< "ok", or the name of an error
    std::string execution; ///< of an error
    std::string payload;
};

/// Which requests were begun and how they were answered, on disk, so that a request that is delivered twice is executed
/// once, also by another life of the process. Used on one loop; each call blocks while the disk works.
class call_journal {
public:
    static constexpr std::int64_t max_calls = 100'000;          ///< remembered; the oldest go
    static constexpr std::int64_t max_answer_bytes = 256 << 20; ///< of their answers; the oldest answers go

    enum class state {
        fresh,       ///< noted as begun: execute it, then call `end`
        running,     ///< it is being executed
        answered,    ///< `outcome` has the answer
        dropped,     ///< it was answered, and the answer is not kept any more
        interrupted, ///< an earlier life began it: it may have been executed
        other,       ///< the same key was used for another request
    };
    struct finding {
        state is = state::fresh;
        call_outcome outcome;
    };

    /// `db` must outlive it. `life`: another number in each life of the process. `remember`: how long.
    call_journal(database& db, std::uint64_t life, duration remember, std::int64_t answer_bytes = max_answer_bytes)
        : db_(&db), life_(static_cast<std::int64_t>(life)), remember_(remember), answer_bytes_(answer_bytes) {}

    /// Notes a request on disk. Errors: those of the database; it must not be executed then.
    result<finding> begin(const std::string& key, const std::string& topic, const std::string& request, wall_time now);
    /// Notes the answer. After an error of the database the request counts as interrupted if it comes again.
    result<void> end(const std::string& key, const call_outcome& outcome);
    /// Forgets what is too old.
    result<void> tidy(wall_time now);

private:
    result<void> bound_answers();

    database* db_;
    std::int64_t life_;
    duration remember_;
    std::int64_t answer_bytes_;
    std::optional<std::int64_t> kept_bytes_; ///< of answers; nothing: to be counted
    std::set<std::string> running_;
};

} // namespace ise::mqtt
