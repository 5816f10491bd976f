// What the components of a random deployment say to each other, in two versions that live side by side.
#pragma once
#include <ise/session/contract.hpp>

#include <ise/sim/random.hpp>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace seeds {

struct job {
    std::uint64_t id = 0;          ///< of the call, unique in a run
    std::uint32_t work_ms = 0;     ///< how long the handler takes
    bool call_back = false;        ///< ask the caller, over the session that the request came by
    bool fail = false;             ///< throw
    std::vector<std::string> hops; ///< further components to call, one after the other
    std::vector<std::uint8_t> content;
};
struct done {
    std::uint64_t id = 0;
    std::uint64_t check = 0; ///< of the content
    std::vector<std::uint8_t> content;
};

/// The same a year later.
struct later_job {
    std::uint64_t id = 0;
    std::uint32_t work_ms = 0;
    bool call_back = false;
    bool fail = false;
    std::vector<std::string> hops;
    std::vector<std::uint8_t> content;
    std::string note = "later";
};
struct later_done {
    std::uint64_t id = 0;
    std::uint64_t check = 0;
    std::vector<std::uint8_t> content;
    std::uint32_t grade = 3;
};

struct beat {
    std::uint64_t life = 0;   ///< of the publication, unique in a run
    std::uint64_t number = 0; ///< within that life: 1, 2, 3…
    std::uint64_t check = 0;
    std::vector<std::uint8_t> content;
};
struct later_beat {
    std::uint64_t life = 0;
    std::uint64_t number = 0;
    std::uint64_t check = 0;
    std::vector<std::uint8_t> content;
    std::string note = "later";
};

template <class Request, class Response>
struct call_services {
    ise::request_response<Request, Response> instant{"instant"}; ///< a plain function
    ise::request_response<Request, Response> working{"working"}; ///< a coroutine
    ise::request_response<Request, Response> alone{"alone"};     ///< exclusive
};
inline constexpr call_services<job, done> calls_now{};
inline constexpr call_services<later_job, later_done> calls_later{};

inline constexpr ise::subscription<beat> beats{"beats"};
inline constexpr ise::subscription<later_beat> later_beats{"beats"};

inline std::uint64_t sum_of(const std::vector<std::uint8_t>& content) noexcept {
    std::uint64_t sum = 0xCBF29CE484222325u + content.size();
    std::size_t at = 0;
    for (; at + 8 <= content.size(); at += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, content.data() + at, 8);
        sum = (sum ^ word) * 0x100000001B3u;
    }
    for (; at < content.size(); ++at) sum = (sum ^ content[at]) * 0x100000001B3u;
    return sum;
}

/// Content of a random length: mostly short, now and then up to `most`.
inline std::vector<std::uint8_t> random_content(ise::sim::generator& draw, std::uint32_t most) {
    auto limit = draw.chance(0.05) ? most : std::min<std::uint32_t>(most, 200);
    std::vector<std::uint8_t> made(draw.below(limit + 1));
    for (std::size_t at = 0; at + 8 <= made.size(); at += std::max<std::size_t>(8, made.size() / 64)) {
        auto word = draw.next();
        std::memcpy(made.data() + at, &word, 8);
    }
    return made;
}

} // namespace seeds
