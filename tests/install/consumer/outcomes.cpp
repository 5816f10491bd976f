// What users write with results, compiled with their warnings and never run: where g++ 12 inlined results it told of
// texts that are not initialized, and of freeing what is not of the heap.
#include <ise/ise.hpp>

#include <optional>
#include <string>
#include <vector>

using namespace std::chrono_literals;

struct picture {
    std::vector<std::uint8_t> pixels;
};
struct log_page {
    std::vector<int> lines;
    std::string title;
    std::optional<std::string> signature;
};

inline constexpr ise::request_response<picture, picture> develop{"develop"};

ise::result<picture> take_picture(int number);
ise::result<log_page> read_page(int number);
bool sharp(const picture& shot);

ise::result<picture> sharp_picture(int number) {
    auto shot = take_picture(number);
    if (!shot) return shot.error();
    if (!sharp(*shot)) shot = ise::failure(ise::errc::refused, "it is blurred");
    return shot;
}

ise::result<log_page> signed_page(int number) {
    ise::result<log_page> page{log_page{}};
    try {
        page = read_page(number);
        if (!page || !page->signature) page = ise::failure(ise::errc::refused, "nobody signed it");
    } catch (const ise::error& problem) {
        page = ise::failure(problem.code(), problem.what());
    }
    auto kept = page;
    if (number > 0) kept = std::move(page);
    return kept;
}

std::size_t weight(int number) {
    auto shot = sharp_picture(number);
    auto page = signed_page(number);
    return shot && page ? shot->pixels.size() + page->lines.size() : 0;
}

ise::task<ise::result<picture>> developed(ise::remote laboratory, const picture& shot) {
    auto made = co_await laboratory.try_call(develop, shot, 2s);
    if (!made) co_return made.error();
    co_return made;
}
