// Sets of numbers as intervals, against sets of numbers.
#include <ise/core/interval_set.hpp>

#include <support/catch.hpp>

#include <random>
#include <set>

namespace interval_set_test {

using ise::interval_set;

namespace {

// Disjoint, ascending, with something between each two; and the same numbers.
void check_same(const interval_set& set, const std::set<std::uint64_t>& model) {
    std::set<std::uint64_t> numbers;
    std::uint64_t last_end = 0;
    bool first = true;
    for (auto [begin, end] : set.all()) {
        REQUIRE(begin < end);
        REQUIRE((first || begin > last_end));
        for (auto n = begin; n < end; ++n) numbers.insert(n);
        last_end = end;
        first = false;
    }
    REQUIRE(numbers == model);
}

} // namespace

TEST_CASE("intervals of numbers are what a set of the numbers is") {
    std::mt19937_64 draw(GENERATE(1u, 2u, 3u, 4u));
    interval_set set;
    std::set<std::uint64_t> model;
    for (int step = 0; step < 3000; ++step) {
        auto begin = draw() % 120, end = begin + draw() % 12;
        if (draw() % 2) {
            bool apart = begin < end;
            for (auto n = begin == 0 ? 0 : begin - 1; n <= end; ++n) apart = apart && !model.contains(n);
            if (begin < end) REQUIRE(set.apart(begin, end) == apart);
            set.add(begin, end);
            for (auto n = begin; n < end; ++n) model.insert(n);
        } else {
            set.remove(begin, end);
            for (auto n = begin; n < end; ++n) model.erase(n);
        }
        if (draw() % 40 == 0 && !set.empty()) {
            auto [from, to] = set.all().front();
            set.drop_first();
            for (auto n = from; n < to; ++n) model.erase(n);
        }
        check_same(set, model);
        for (std::uint64_t n = 0; n < 140; ++n) REQUIRE(set.contains(n) == model.contains(n));
    }
}

} // namespace interval_set_test
