#include <components/postgres/postgres.hpp>

namespace atirma {
namespace {

ise::failure not_built() {
    return ise::failure(ise::errc::invalid_argument,
                        "a store on PostgreSQL needs libpq, and this program was built without it: install "
                        "libpq-dev and build again, or use a file");
}

} // namespace

class postgres_client::state {};
class postgres_session::state {};

bool has_postgres() noexcept { return false; }
ise::result<void> check_postgres_url(const std::string&) { return not_built(); }
std::string postgres_name(const std::string&) { return "PostgreSQL"; }

postgres_client::postgres_client(ise::loop&, const std::string&, events) { throw ise::error(not_built()); }
postgres_client::~postgres_client() = default;
void postgres_client::start() {}
void postgres_client::query(std::string, std::vector<postgres_value>, then) {}
void postgres_client::drop(const ise::failure&) {}

ise::result<postgres_session> postgres_session::open(const std::string&) { return not_built(); }
postgres_session::postgres_session(std::unique_ptr<state> made) : state_(std::move(made)) {}
postgres_session::postgres_session(postgres_session&&) noexcept = default;
postgres_session& postgres_session::operator=(postgres_session&&) noexcept = default;
postgres_session::~postgres_session() = default;
ise::result<postgres_rows> postgres_session::query(const std::string&, const std::vector<postgres_value>&) {
    return not_built();
}
ise::result<void> postgres_session::run_script(const std::string&) { return not_built(); }
ise::result<void> postgres_session::copy_in(const std::string&, const std::string&) { return not_built(); }

} // namespace atirma
