-- What has been delivered: the fleet's own table, beside the schema of the library. (It has no key: then a second
-- delivery would not be refused, but be seen.)
create table delivered (
  number int not null,
  robot text not null,
  at timestamptz not null default now()
);

grant insert on delivered to fleet_robot;
